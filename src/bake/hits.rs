//! Hits of one batch of directions: found tile by tile, and stored where later rounds want them again.

use std::collections::BTreeMap;

use super::accumulation::TILE;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{Found, HitFinder, Recorder, StoredHits, hit_finder};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::points::{PointList, Points};
use crate::prepared::Prepared;
use crate::settings::GatherSettings;

/// The hits of each tile, by the first direction of their batch.
pub type VertexHits = BTreeMap<u32, Vec<StoredHits>>;

/// Finds hits and records them, for several passes read them.
pub struct HitSource {
    recorder: Recorder,
    finder: Box<dyn HitFinder>,
}

impl HitSource {
    /// For so many points at a time, with layers of so many texels on a side.
    ///
    /// # Errors
    /// When layers are beyond the device's limits, or it has no memory for the hits of a batch.
    pub fn new(gpu: &Gpu, gather: &GatherSettings, layers: u32, prepared: &Prepared, points: usize) -> Result<Self> {
        let size = PointList::size(points.min(TILE));
        // The finder comes last: it makes do with the memory that is left.
        let recorder = Recorder::new(gpu, gather.pipeline, size)?;
        Ok(Self { recorder, finder: hit_finder(gpu, gather, layers, &prepared.scene, &prepared.bvh, size)? })
    }

    /// The most directions at once.
    pub fn batch(&self) -> usize {
        self.finder.batch()
    }

    /// Gives memory back that it can do without, if any.
    pub fn shrink(&mut self) -> bool {
        self.finder.shrink()
    }
}

/// The hits of one batch.
pub struct BatchHits<'a> {
    source: &'a mut HitSource,
    stored: Option<&'a mut Vec<StoredHits>>,
    /// How many directions it has.
    pub directions: usize,
}

impl<'a> BatchHits<'a> {
    /// Along some of `directions`, the first ones; the stored ones if there are any.
    pub fn begin(
        source: &'a mut HitSource,
        stored: Option<&'a mut Vec<StoredHits>>,
        geometry: &Geometry,
        directions: &[Direction],
    ) -> Result<Self> {
        let known = stored.as_ref().and_then(|tiles| tiles.first()).map(StoredHits::directions);
        let directions = known.map_or_else(|| source.finder.begin(geometry, directions), Ok)?;
        Ok(Self { source, stored, directions })
    }

    /// The hits of tile `index`, whose points are these. Tiles come in order.
    pub fn of_tile(&mut self, geometry: &Geometry, index: usize, points: Points) -> Result<Found<'_>> {
        let HitSource { recorder, finder } = self.source;
        let Some(tiles) = &mut self.stored else { return Ok(recorder.record(finder.find(geometry, points)?, points)) };
        if index == tiles.len() {
            tiles.push(recorder.keep(&finder.find(geometry, points)?, points)?);
        }
        Ok(tiles[index].found())
    }
}
