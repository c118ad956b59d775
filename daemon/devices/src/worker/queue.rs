//! Bounded queues between devices and the tick in which the newest wins.

use crossbeam_channel::{Receiver, Sender, TrySendError, bounded};

/// The writing end. There is one: it alone decides what gives way.
#[derive(Debug)]
pub struct NewestSender<T> {
    queue: Sender<T>,
    /// The same queue's other end, to take out the oldest.
    oldest: Receiver<T>,
    dropped: u64,
}

/// A queue of at most `capacity` (at least 1) in which, when it is full, the oldest gives way to the newest.
pub fn newest<T>(capacity: usize) -> (NewestSender<T>, Receiver<T>) {
    let (queue, receiver) = bounded(capacity.max(1));
    (NewestSender { queue, oldest: receiver.clone(), dropped: 0 }, receiver)
}

impl<T> NewestSender<T> {
    /// Puts `item` in; never blocks.
    pub fn send(&mut self, item: T) {
        let mut item = item;
        loop {
            match self.queue.try_send(item) {
                // This end holds a receiver: the queue is never disconnected from here.
                Ok(()) | Err(TrySendError::Disconnected(_)) => return,
                Err(TrySendError::Full(back)) => {
                    item = back;
                    self.dropped += u64::from(self.oldest.try_recv().is_ok());
                }
            }
        }
    }

    /// How many have given way so far.
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_remain_in_order_and_the_rest_is_counted() {
        let (mut sender, receiver) = newest(3);
        (0..10).for_each(|n| sender.send(n));
        assert_eq!(sender.dropped(), 7);
        assert_eq!(receiver.try_iter().collect::<Vec<_>>(), [7, 8, 9]);
        sender.send(10);
        assert_eq!((receiver.try_recv(), sender.dropped()), (Ok(10), 7));
    }
}
