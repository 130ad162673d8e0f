//! Merges the parts of a bake's shards from their files. It needs no GL and no photons.

use std::path::Path;

use serde_json::Value;

use super::accumulation::RoundSums;
use super::points::PointRun;
use super::schedule::{PointSet, Round};
use super::{Plan, blocks_of, digest};
use crate::blocks::{Blocks, Node, PairwiseSum, Part};
use crate::error::{Error, Result};
use crate::image::Channel;
use crate::points::GatherPoint;
use crate::prepared::Prepared;
use crate::scene::Scene;
use crate::settings::Settings;

/// The merged parts of one bake. All parts must come from the same renderer; any renderer will do.
pub struct Merge {
    job: Value,
    settings: Settings,
    plan: Plan,
    blocks: Blocks,
    runs: Vec<PointRun>,
    sums: RoundSums,
}

impl Merge {
    /// An empty merge for the bake that made `part`, a file at `path`.
    ///
    /// # Errors
    /// [`Error::Input`] when the part is of another version or damaged.
    pub fn new(path: &Path, part: &Part) -> Result<Self> {
        part.check_version(path)?;
        let settings: Settings = Part::parse_value(path, &part.job["settings"])?;
        let plan: Plan = Part::parse_value(path, &part.job["plan"])?;
        let runs: Vec<PointRun> = Part::parse_value(path, &part.state["runs"])?;
        let damaged = |_| Error::input(path, None, "damaged: its settings are out of range", "make it again");
        settings.validate().and_then(|()| plan.validate()).map_err(damaged)?;
        if PointRun::count(&runs).is_none() {
            return Err(Error::input(path, None, "damaged: its points take impossible turns", "make it again"));
        }
        let blocks = blocks_of(&settings.directions, PointRun::turns(&runs));
        Ok(Self { job: part.job.clone(), settings, plan, blocks, runs, sums: RoundSums::default() })
    }

    /// Adds the blocks of a part's last stage.
    ///
    /// # Errors
    /// [`Error::Input`] when the part is of another bake, is damaged, or repeats blocks.
    pub fn add(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job)?;
        let plan = self.plan.by(path, part)?;
        let (mut nodes, mut direct) = (Vec::new(), Vec::new());
        // Each round has other points. Their sums are joined for each block.
        for round in Round::split(&plan, self.blocks, PointSet::Receivers, &self.runs, plan.stages()) {
            let own = RoundSums::read(path, part, &round, &plan.wanted(true), self.blocks)?;
            let same = nodes.iter().map(Node::range).eq(own.values.nodes().iter().map(Node::range));
            if round.points.start == 0 {
                nodes = own.values.into_nodes();
            } else if same {
                nodes.iter_mut().zip(own.values.nodes()).for_each(|(node, further)| node.sum.append(&further.sum));
            } else {
                let problem = "not complete: some points are further than others";
                return Err(Error::input(path, None, problem, "run its shard again with --resume"));
            }
            direct.extend(own.direct);
        }
        let mut sum = PairwiseSum::default();
        nodes.into_iter().for_each(|node| sum.insert(node).unwrap_or_else(|_| unreachable!("nodes of a tree")));
        self.blocks.merge(path, &mut self.sums.values, sum)?;
        if !direct.is_empty() {
            self.sums.direct = direct;
        }
        Ok(())
    }

    /// # Errors
    /// [`Error::Usage`] that names the missing directions.
    pub fn check_whole(&self) -> Result<()> {
        self.blocks.check_whole(&self.sums.values)
    }

    /// Checks that the bake used `scene`, in unit space and without glass, and `points`. `path` is a part.
    ///
    /// # Errors
    /// [`Error::Input`] that names the difference.
    pub fn check_scene(&self, path: &Path, scene: &Scene, points: &[GatherPoint]) -> Result<()> {
        if PointRun::count(&self.runs) != Some(points.len()) {
            let problem = format!("damaged: it is not of the {} points of this bake", points.len());
            return Err(Error::input(path, None, problem, "make it again"));
        }
        let mut job = self.job.clone();
        [job["scene"], job["points"]] = digest(scene, points);
        Part::new(self.job.clone(), Value::Null).check(path, &job)
    }

    /// A value for each of `points`, the points of all receivers of `prepared` in order, as [`super::Bake::columns`].
    ///
    /// # Errors
    /// As [`Self::check_whole`].
    pub fn columns(&self, prepared: &Prepared, points: &[GatherPoint]) -> Result<(Vec<Channel>, Vec<f32>)> {
        self.check_whole()?;
        let values = self.sums.values.total().unwrap_or_default();
        Ok(self.plan.columns(&values, &self.sums.direct, points, prepared, &self.settings))
    }

    /// As [`super::Bake::job`]. It contains `settings` and `plan`.
    pub fn job(&self) -> &Value {
        &self.job
    }

    /// The settings of the bake, with an exposure of 0.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}
