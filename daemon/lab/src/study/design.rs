//! Which pictures there are, and in what order each participant sees them.

use rand::{SeedableRng, seq::SliceRandom};
use rand_pcg::Pcg64Mcg;

/// Levels of the four factors (Nelson 2009, table 2); `false` is the first level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition {
    /// The second method.
    pub second_method: bool,
    /// With shadow.
    pub shadow: bool,
    /// The second background.
    pub second_background: bool,
    /// A picture of a boat instead of one with a shape.
    pub textured: bool,
}

/// All 2^4 conditions.
pub const CONDITIONS: [Condition; 16] = {
    let mut all =
        [Condition { second_method: false, shadow: false, second_background: false, textured: false }; 16];
    let mut i = 0;
    while i < 16 {
        all[i] = Condition {
            second_method: i & 8 != 0,
            shadow: i & 4 != 0,
            second_background: i & 2 != 0,
            textured: i & 1 != 0,
        };
        i += 1;
    }
    all
};

/// Pictures of each condition.
pub const REPLICATES: usize = 4;

/// One picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StudyItem {
    /// A photograph of a real reflection, by number.
    Real(usize),
    /// A drawn one.
    Generated {
        /// Index into [`CONDITIONS`].
        condition: usize,
        /// Which of its pictures.
        replicate: usize,
    },
}

/// Pictures and orders.
#[derive(Clone, Debug)]
pub struct Design {
    /// All pictures, shuffled: a picture's name tells nothing.
    pub items: Vec<StudyItem>,
    /// For each participant the indices of [`Design::items`] in order.
    pub orders: Vec<Vec<usize>>,
}

impl Design {
    /// A design with so many real pictures; the same seed gives the same.
    ///
    /// Each participant sees four blocks. A block holds every condition once and its share of the real pictures, shuffled; the
    /// blocks go round like a Latin square, so that over four participants each picture comes as early as any other.
    pub fn new(real: usize, participants: usize, seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut items: Vec<StudyItem> = (0..real).map(StudyItem::Real).collect();
        for condition in 0..CONDITIONS.len() {
            items.extend((0..REPLICATES).map(|replicate| StudyItem::Generated { condition, replicate }));
        }
        items.shuffle(&mut random);
        let orders = (0..participants).map(|p| order(&items, p, &mut random)).collect();
        Self { items, orders }
    }

    /// The name of a picture.
    pub fn name(&self, index: usize) -> String {
        format!("p{:03}", index + 1)
    }

    /// Indices of all items, those of one condition together.
    pub fn by_condition(&self) -> Vec<usize> {
        let mut all: Vec<usize> = (0..self.items.len()).collect();
        all.sort_by_key(|&i| match self.items[i] {
            StudyItem::Real(n) => (usize::MAX, n),
            StudyItem::Generated { condition, replicate } => (condition, replicate),
        });
        all
    }
}

fn order(items: &[StudyItem], participant: usize, random: &mut Pcg64Mcg) -> Vec<usize> {
    let mut blocks: [Vec<usize>; REPLICATES] = Default::default();
    for (index, item) in items.iter().enumerate() {
        let block = match *item {
            // Real pictures are dealt out evenly; conditions begin their replicates at different blocks, so that a block
            // holds all boats.
            StudyItem::Real(number) => number,
            StudyItem::Generated { condition, replicate } => condition + replicate,
        };
        blocks[(block + participant) % REPLICATES].push(index);
    }
    for block in &mut blocks {
        block.shuffle(random);
    }
    blocks.concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_has_every_condition_once_and_its_share_of_the_real_ones() {
        let design = Design::new(18, 8, 7);
        assert_eq!(design.items.len(), 82);
        for order in &design.orders {
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..82).collect::<Vec<_>>(), "each picture is seen once");
            let mut begin = 0;
            for _ in 0..REPLICATES {
                // A block ends where its 16 conditions are complete and the next item repeats one.
                let (mut seen, mut real, mut end) = ([0; 16], 0, begin);
                while end < order.len() {
                    match design.items[order[end]] {
                        StudyItem::Real(_) => real += 1,
                        StudyItem::Generated { condition, .. } if seen[condition] == 1 => break,
                        StudyItem::Generated { condition, .. } => seen[condition] += 1,
                    }
                    end += 1;
                }
                assert_eq!(seen, [1; 16]);
                assert!(real <= 10, "{real}");
                begin = end;
            }
            assert_eq!(begin, 82);
        }
    }

    #[test]
    fn over_four_participants_every_picture_comes_in_every_quarter() {
        let design = Design::new(16, 4, 3);
        for index in 0..design.items.len() {
            let place = |order: &Vec<usize>| order.iter().position(|&i| i == index).unwrap_or(999) / 20;
            let mut quarters: Vec<usize> = design.orders.iter().map(place).collect();
            quarters.sort_unstable();
            assert_eq!(quarters, [0, 1, 2, 3]);
        }
    }

    #[test]
    fn the_seed_decides() {
        let (a, b, c) = (Design::new(5, 3, 1), Design::new(5, 3, 1), Design::new(5, 3, 2));
        assert!(a.items == b.items && a.orders == b.orders);
        assert!(a.items != c.items || a.orders != c.orders);
    }
}
