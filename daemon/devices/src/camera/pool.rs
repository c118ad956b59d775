//! Buffers for pictures that are used again once nobody holds them.

use std::sync::Arc;

/// Buffers kept for use again: the queue, the one in work, and those that session and renderer hold.
const BUFFERS_MAX: usize = 8;

/// Buffers that were given away; free again when nobody else holds them.
#[derive(Debug, Default)]
pub(super) struct Pool {
    buffers: Vec<Arc<[u8]>>,
}

impl Pool {
    /// A buffer of `len` bytes, filled by `fill`. Its former contents are still in it when `fill` is called.
    pub fn filled<E>(
        &mut self,
        len: usize,
        fill: impl FnOnce(&mut [u8]) -> Result<(), E>,
    ) -> Result<Arc<[u8]>, E> {
        self.buffers.retain(|b| b.len() == len);
        let free = self.buffers.iter_mut().position(|b| Arc::get_mut(b).is_some());
        let mut buffer = match free {
            Some(at) => self.buffers.swap_remove(at),
            None => std::iter::repeat_n(0, len).collect(),
        };
        // Ours alone: it is new, or it was found to be free and the pool holds the only other handle there ever was.
        if let Some(bytes) = Arc::get_mut(&mut buffer) {
            fill(bytes)?;
        }
        if self.buffers.len() < BUFFERS_MAX {
            self.buffers.push(Arc::clone(&buffer));
        }
        Ok(buffer)
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::HashSet, convert::Infallible};

    use super::*;

    fn filled(pool: &mut Pool, len: usize, value: u8) -> Arc<[u8]> {
        pool.filled(len, |bytes| {
            bytes.fill(value);
            Ok::<_, Infallible>(())
        })
        .unwrap()
    }

    #[test]
    fn buffers_are_used_again_but_never_while_held() {
        let mut pool = Pool::default();
        let held = filled(&mut pool, 100, 1);
        let places: HashSet<_> = (0..20).map(|_| filled(&mut pool, 100, 2).as_ptr()).collect();
        assert_eq!(places.len(), 1);
        let many: Vec<_> = (0..3 * BUFFERS_MAX).map(|_| filled(&mut pool, 100, 3)).collect();
        assert!(many.iter().all(|b| b.iter().all(|v| *v == 3)) && pool.buffers.len() <= BUFFERS_MAX);
        assert!(held.iter().all(|v| *v == 1));
        assert_eq!(filled(&mut pool, 50, 4).len(), 50);
        assert_eq!(pool.buffers.len(), 1, "buffers of another size are not kept");
    }
}
