//! Hits of a batch of directions. They are found tile by tile, and stored if later rounds use them again.

use std::collections::BTreeMap;

use super::accumulation::TILE;
use super::schedule::PointSet;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{Found, HitFinder, Recorder, StoredHits, hit_finder};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::points::{GatherPoint, PointList, Points};
use crate::prepared::Prepared;
use crate::settings::GatherSettings;

/// The hits of each tile. The key is the first direction of the batch.
pub type VertexHits = BTreeMap<u32, Vec<StoredHits>>;

/// A hit finder with a recorder. Hits are recorded because several passes read them.
pub struct HitSource {
    recorder: Recorder,
    finder: Box<dyn HitFinder>,
    /// The points that the finder fits.
    fitted: Option<PointSet>,
}

impl HitSource {
    /// `points`: points at a time. `layers`: side of the layers in texels.
    ///
    /// # Errors
    /// When layers exceed the device's limits, or its memory cannot hold the hits of a batch.
    pub fn new(gpu: &Gpu, gather: &GatherSettings, layers: u32, prepared: &Prepared, points: usize) -> Result<Self> {
        let size = PointList::size(points.min(TILE));
        // Built last, because the finder adapts to the remaining memory.
        let recorder = Recorder::new(gpu, gather.pipeline, &prepared.scene, size)?;
        let finder = hit_finder(gpu, gather, layers, &prepared.scene, &prepared.bvh, size)?;
        Ok(Self { recorder, finder, fitted: None })
    }

    /// Fits the finder to all points of a set. Rounds have a part of them, and memory decides which; the sums must not depend on that.
    pub fn fit(&mut self, set: PointSet, points: &[GatherPoint]) {
        if self.fitted.replace(set) != Some(set) {
            self.finder.fit(&|| points.iter().map(|point| point.position).collect());
        }
    }

    /// Maximum number of directions in a batch.
    pub fn batch(&self) -> usize {
        self.finder.batch()
    }

    /// Frees some memory. Returns false if nothing can be freed.
    pub fn shrink(&mut self) -> bool {
        self.finder.shrink()
    }
}

pub struct BatchHits<'a> {
    source: &'a mut HitSource,
    stored: Option<&'a mut Vec<StoredHits>>,
    /// Number of directions in the batch.
    pub directions: usize,
}

impl<'a> BatchHits<'a> {
    /// Begins a batch of the first few of `directions`, or of the stored hits if there are any.
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

    /// The hits of tile `index` with these points. Call it for the tiles in order.
    pub fn of_tile(&mut self, geometry: &Geometry, index: usize, points: Points) -> Result<Found<'_>> {
        let HitSource { recorder, finder, .. } = self.source;
        let Some(tiles) = &mut self.stored else { return Ok(recorder.record(finder.find(geometry, points)?, points)) };
        if index == tiles.len() {
            tiles.push(recorder.keep(&finder.find(geometry, points)?, points)?);
        }
        Ok(tiles[index].found())
    }
}
