//! Pairwise summation over blocks, as a binary tree over the block index. Blocks may come in any order and from any machine.
//!
//! Block i is leaf i. A node of 2^k blocks begins at a multiple of 2^k. Its sum is its first half plus its second half, in this order. If the
//! number of blocks is no power of two, the blocks after the largest node are summed in the same way and added to it: for seven blocks,
//! (0..4) + ((4..6) + 6). The bits of the result depend on this tree alone, as long as every machine sums whole nodes. The error of 32-bit
//! floats grows with the logarithm of the number of blocks. That of a running sum grows with the number itself.

use std::borrow::Cow;
use std::ops::Range;

/// Values that can be added.
pub trait Sum: Clone {
    /// Adds the sum of later blocks.
    fn add(&mut self, later: &Self);
}

/// The sum of consecutive blocks.
#[derive(Clone, Debug, PartialEq)]
pub struct Node<T> {
    pub first: u32,
    /// A power of two that divides `first`.
    pub blocks: u32,
    pub sum: T,
}

impl<T> Node<T> {
    /// The blocks.
    pub fn range(&self) -> Range<u32> {
        self.first..self.first.saturating_add(self.blocks)
    }

    /// Whether it is a node of the tree.
    pub fn is_aligned(&self) -> bool {
        self.blocks.is_power_of_two() && self.first.is_multiple_of(self.blocks)
    }
}

/// The blocks so far, as the largest nodes of them. The last two nodes are not joined, because their difference estimates the error.
#[derive(Debug)]
pub struct PairwiseSum<T> {
    /// Sorted by their blocks.
    nodes: Vec<Node<T>>,
    /// A value that is no longer needed, for its memory.
    spare: Option<T>,
}

impl<T> Default for PairwiseSum<T> {
    fn default() -> Self {
        Self { nodes: Vec::new(), spare: None }
    }
}

impl<T: Clone> Clone for PairwiseSum<T> {
    fn clone(&self) -> Self {
        Self { nodes: self.nodes.clone(), spare: None }
    }
}

impl<T: Sum> PairwiseSum<T> {
    /// Adds a node. Returns it as an error if it is not aligned or some of its blocks are in the sum already.
    pub fn insert(&mut self, node: Node<T>) -> Result<(), Node<T>> {
        let place = self.nodes.partition_point(|earlier| earlier.first < node.first);
        let after = place == 0 || self.nodes[place - 1].range().end <= node.first;
        let before = self.nodes.get(place).is_none_or(|later| node.range().end <= later.first);
        if !(node.is_aligned() && after && before) {
            return Err(node);
        }
        self.nodes.insert(place, node);
        self.join();
        Ok(())
    }

    /// Joins what can be joined. Returns a value that is no longer needed.
    fn join(&mut self) -> Option<T> {
        let mut spare = None;
        while let Some(pair) = self.pair() {
            let later = self.nodes.remove(pair + 1);
            let earlier = &mut self.nodes[pair];
            earlier.sum.add(&later.sum);
            earlier.blocks *= 2;
            spare = Some(later.sum);
        }
        spare
    }

    /// Adds a block.
    ///
    /// # Panics
    /// If the block is in the sum already.
    pub fn insert_block(&mut self, index: u32, sum: T) {
        let inserted = self.insert(Node { first: index, blocks: 1, sum });
        assert!(inserted.is_ok(), "block {index} is there already");
    }

    /// Adds a block with few values at a time: `add` adds it to the block before, if the two are to be joined. Else `new` makes its value, in the memory of
    /// one that is no longer needed, if there is one.
    ///
    /// # Panics
    /// As [`Self::insert_block`].
    pub fn insert_with(&mut self, index: u32, add: impl FnOnce(&mut T), new: impl FnOnce(Option<T>) -> T) {
        let partner =
            |nodes: &[Node<T>]| nodes.iter().position(|node| node.blocks == 1 && Some(node.first) == index.checked_sub(1));
        let is_missing = !self.missing(index..index + 1).is_empty();
        let partner = partner(&self.nodes).filter(|_| self.nodes.len() > 1 && index % 2 == 1 && is_missing);
        let unused = match partner {
            Some(partner) => {
                let node = &mut self.nodes[partner];
                add(&mut node.sum);
                node.blocks = 2;
                self.join()
            }
            None => {
                assert!(is_missing, "block {index} is there already");
                let node = Node { first: index, blocks: 1, sum: new(self.spare.take()) };
                self.nodes.insert(self.nodes.partition_point(|earlier| earlier.first < index), node);
                self.join()
            }
        };
        self.spare = unused.or(self.spare.take());
    }

    /// Frees memory that [`Self::insert_with`] keeps.
    pub fn shrink(&mut self) {
        self.spare = None;
    }

    /// The index of the first of two nodes that can be joined, unless these are all nodes.
    fn pair(&self) -> Option<usize> {
        let halves = |pair: &[Node<T>]| {
            let (a, b) = (&pair[0], &pair[1]);
            a.blocks == b.blocks && (a.first / a.blocks).is_multiple_of(2) && a.range().end == b.first
        };
        if self.nodes.len() > 2 { self.nodes.windows(2).position(halves) } else { None }
    }

    /// The largest nodes so far, in order. A complete tree has two nodes.
    pub fn nodes(&self) -> &[Node<T>] {
        &self.nodes
    }

    pub fn into_nodes(self) -> Vec<Node<T>> {
        self.nodes
    }

    /// Number of blocks so far.
    pub fn blocks(&self) -> u32 {
        self.nodes.iter().map(|node| node.blocks).sum()
    }

    /// The blocks of `range` that are not in the sum.
    pub fn missing(&self, range: Range<u32>) -> Vec<Range<u32>> {
        let mut from = range.start;
        let mut missing = Vec::new();
        for node in self.nodes.iter().map(Node::range).filter(|node| node.end > range.start && node.start < range.end) {
            if from < node.start {
                missing.push(from..node.start);
            }
            from = node.end;
        }
        if from < range.end {
            missing.push(from..range.end);
        }
        missing
    }

    /// The sum of all blocks; `None` if there are none. It has the bits of the tree only if no block before the last is missing.
    pub fn total(&self) -> Option<T> {
        total(&self.nodes).map(Cow::into_owned)
    }

    /// The most nodes at a time while `blocks` blocks are inserted in order, with the inserted one.
    pub fn most_nodes(blocks: u32) -> u32 {
        1 + blocks.saturating_sub(1).checked_ilog2().map_or(0, |log| log + 1)
    }

    /// The number of nodes once all these blocks are inserted.
    pub fn nodes_of(blocks: Range<u32>) -> u32 {
        let (mut count, mut at) = (0, blocks.start);
        while at < blocks.end {
            at += 1 << (blocks.end - at).ilog2().min(at.trailing_zeros());
            count += 1;
        }
        // The last two nodes are not joined.
        count.max(blocks.len().min(2) as u32)
    }
}

/// The sum of all nodes, without a copy if there is one node.
fn total<T: Sum>(nodes: &[Node<T>]) -> Option<Cow<'_, T>> {
    let later = |later: Cow<T>, earlier: &Node<T>| {
        let mut sum = earlier.sum.clone();
        sum.add(&later);
        Cow::Owned(sum)
    };
    let (last, earlier) = nodes.split_last()?;
    Some(earlier.iter().rev().fold(Cow::Borrowed(&last.sum), later))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    impl Sum for f32 {
        fn add(&mut self, later: &Self) {
            *self += later;
        }
    }

    /// A string shows the order of additions.
    impl Sum for String {
        fn add(&mut self, later: &Self) {
            *self = format!("({self}+{later})");
        }
    }

    fn in_order(count: u32) -> PairwiseSum<String> {
        let mut sum = PairwiseSum::default();
        (0..count).for_each(|index| sum.insert_block(index, index.to_string()));
        sum
    }

    #[test]
    fn the_tree_is_as_documented() {
        assert_eq!(in_order(7).total().unwrap(), "(((0+1)+(2+3))+((4+5)+6))");
        assert_eq!(in_order(4).total().unwrap(), "((0+1)+(2+3))");
        assert_eq!(in_order(1).total().unwrap(), "0");
        assert_eq!(in_order(0).total(), None);
    }

    #[test]
    fn most_nodes_are_not_passed_and_one_too_many_at_most() {
        for count in 1..200 {
            let (mut sum, mut most) = (PairwiseSum::default(), 0);
            for index in 0..count {
                most = most.max(sum.nodes().len() + 1);
                sum.insert_block(index, 1.0);
            }
            let bound = PairwiseSum::<f32>::most_nodes(count) as usize;
            assert!((most..=most + 1).contains(&bound), "{most} of {count} blocks, and {bound} was said");
        }
    }

    #[test]
    fn nodes_of_blocks_are_those_they_make() {
        for start in 0..40 {
            for end in start..80 {
                let mut sum = PairwiseSum::default();
                (start..end).for_each(|index| sum.insert_block(index, 1.0));
                assert_eq!(PairwiseSum::<f32>::nodes_of(start..end) as usize, sum.nodes().len(), "{start}..{end}");
            }
        }
    }

    #[test]
    fn blocks_added_to_their_partners_make_the_same_tree() {
        let mut numbers = Random::new(4, 0);
        for trial in 0..2000 {
            let count = 1 + numbers.bits() as u32 % 70;
            let mut blocks: Vec<u32> = (0..count).collect();
            if trial % 2 == 0 {
                shuffle(&mut blocks, &mut numbers);
            }
            let (mut sum, mut plain) = (PairwiseSum::default(), PairwiseSum::default());
            for index in blocks {
                let new = || index.to_string();
                sum.insert_with(index, |earlier: &mut String| earlier.add(&new()), |_| new());
                plain.insert_block(index, new());
                assert_eq!(sum.nodes(), plain.nodes(), "trial {trial}");
            }
        }
    }

    #[test]
    fn any_order_and_any_grouping_by_nodes_is_the_same_sum() {
        let mut numbers = Random::new(1, 0);
        for trial in 0..2000 {
            let count = 1 + numbers.bits() as u32 % 70;
            // Each group sums its own run of blocks.
            let mut bounds: Vec<u32> = (0..numbers.bits() % 5).map(|_| numbers.bits() as u32 % (count + 1)).collect();
            bounds.extend([0, count]);
            bounds.sort_unstable();
            let mut nodes = Vec::new();
            for bounds in bounds.windows(2) {
                let mut blocks: Vec<u32> = (bounds[0]..bounds[1]).collect();
                shuffle(&mut blocks, &mut numbers);
                let mut group = PairwiseSum::default();
                blocks.iter().for_each(|&index| group.insert_block(index, index.to_string()));
                nodes.extend(group.nodes().to_vec());
            }
            shuffle(&mut nodes, &mut numbers);
            let mut sum = PairwiseSum::default();
            nodes.into_iter().for_each(|node| sum.insert(node).unwrap());
            assert_eq!(sum.total(), in_order(count).total(), "trial {trial}");
            assert_eq!(sum.nodes(), in_order(count).nodes(), "trial {trial}");
            assert_eq!(sum.missing(0..count), []);
        }
    }

    fn shuffle<T>(list: &mut [T], numbers: &mut Random) {
        (1..list.len()).for_each(|last| list.swap(last, numbers.bits() as usize % (last + 1)));
    }

    #[test]
    fn what_overlaps_or_stands_askew_is_given_back() {
        let mut sum = PairwiseSum::default();
        for (first, blocks) in [(4, 4), (0, 2), (12, 1)] {
            sum.insert(Node { first, blocks, sum: 1.0 }).unwrap();
        }
        for (first, blocks) in [(4, 1), (7, 1), (0, 8), (1, 1), (12, 4), (2, 3), (2, 4), (8, 0), (u32::MAX, 1 << 31)] {
            assert!(sum.insert(Node { first, blocks, sum: 1.0 }).is_err(), "{first}+{blocks}");
        }
        assert_eq!(sum.missing(0..16), [2..4, 8..12, 13..16]);
        assert_eq!(sum.missing(5..14), [8..12, 13..14]);
        assert_eq!(sum.blocks(), 7);
    }

    #[test]
    fn a_million_blocks_keep_their_digits() {
        let mut numbers = Random::new(2, 0);
        let (mut sum, mut exact, mut running) = (PairwiseSum::default(), 0.0, 0.0_f32);
        for index in 0..1 << 20 {
            let value = numbers.uniform();
            sum.insert_block(index, value);
            exact += f64::from(value);
            running += value;
        }
        let error = |sum: f32| (f64::from(sum) - exact).abs() / exact;
        assert!(error(sum.total().unwrap()) < 1e-6, "{}", error(sum.total().unwrap()));
        // The tree has a purpose only if a running sum has at least ten times its error.
        assert!(error(running) > 1e-5, "{}", error(running));
    }
}
