//! The lists of vertices in a model's file, which [`Source`]s refer to.

use super::{Source, World};

/// The lists of vertices of a model's file, one after the other.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SourceLists {
    /// Where the list of each instance begins.
    firsts: Vec<usize>,
    /// Length of all lists together.
    total: usize,
}

impl SourceLists {
    pub fn of(world: &World) -> Self {
        let lengths = world.instances.iter().map(|instance| world.meshes[instance.mesh].length_of_source() as usize);
        if world.has_one_list {
            return Self { firsts: vec![0; world.instances.len()], total: lengths.max().unwrap_or(0) };
        }
        let mut lists = Self::default();
        for length in lengths {
            lists.firsts.push(lists.total);
            lists.total += length;
        }
        lists
    }

    /// Length of all lists together.
    pub fn total(&self) -> usize {
        self.total
    }

    /// The place of a vertex among all.
    pub fn place(&self, source: Source) -> usize {
        self.firsts[source.instance as usize] + source.index as usize
    }

    /// The vertex at this place, in the first instance of its list.
    pub fn at(&self, place: usize) -> Source {
        let last = self.firsts.partition_point(|&first| first <= place) - 1;
        let instance = self.firsts.partition_point(|&first| first < self.firsts[last]);
        Source { instance: instance as u32, index: (place - self.firsts[instance]) as u32 }
    }
}
