//! Hits of one batch of directions: found tile by tile, and stored where later rounds want them again.

use std::collections::BTreeMap;

use super::accumulation::TILE;
use crate::direction::Direction;
use crate::error::Result;
use crate::gather::{ExactFind, Find, FusedFind, Hits, KeptHits, KillFind, KillGather, RayFind};
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::points::{PointList, Points};
use crate::prepared::Prepared;
use crate::settings::{Pipeline, Settings};

/// The hits of each tile, by the first direction of their batch.
pub type StoredHits = BTreeMap<u32, Vec<KeptHits>>;

/// The hits of one batch.
pub struct BatchHits<'a> {
    finder: &'a mut dyn Find,
    stored: Option<&'a mut Vec<KeptHits>>,
    /// How many directions it has.
    pub directions: usize,
    /// The most layers that were peeled for one of them; 0 where none were.
    pub layers: u32,
}

impl<'a> BatchHits<'a> {
    /// Along some of `directions`, the first ones; the stored ones if there are any.
    pub fn begin(
        finder: &'a mut dyn Find,
        stored: Option<&'a mut Vec<KeptHits>>,
        geometry: &Geometry,
        directions: &[Direction],
    ) -> Result<Self> {
        let known = stored.as_ref().and_then(|tiles| tiles.first()).map(KeptHits::directions);
        let (directions, layers) = match known {
            Some(directions) => (directions, 0),
            None => finder.begin(geometry, directions).map(|begun| (begun.directions, begun.layers))?,
        };
        Ok(Self { finder, stored, directions, layers })
    }

    /// The hits of tile `index`, whose points are these. Tiles come in order.
    pub fn of_tile(&mut self, geometry: &Geometry, index: usize, points: Points) -> Result<Hits<'_>> {
        let Some(tiles) = &mut self.stored else { return self.finder.find(geometry, points) };
        if index == tiles.len() {
            self.finder.find(geometry, points)?;
            tiles.push(self.finder.keep()?);
        }
        Ok(tiles[index].hits())
    }
}

/// Finds hits for so many points at a time.
pub fn finder(gpu: &Gpu, settings: &Settings, prepared: &Prepared, points: usize) -> Result<Box<dyn Find>> {
    let (layers, size) = (settings.layers(), PointList::size(points.min(TILE)));
    Ok(match settings.pipeline {
        Pipeline::Fused => Box::new(FusedFind::new(gpu, layers, size)?),
        Pipeline::Kill => Box::new(KillFind::new(KillGather::new(gpu, layers, size, settings.stop_fraction)?)),
        Pipeline::EarlyKill => Box::new(KillFind::new(KillGather::early(gpu, layers, size, settings.stop_fraction)?)),
        Pipeline::RaycastGl => Box::new(RayFind::new(gpu, &prepared.scene, size)?),
        Pipeline::Raycast => Box::new(ExactFind::new(gpu, &prepared.scene, prepared.bvh.clone())),
    })
}
