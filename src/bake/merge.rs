//! Parts of one bake put together, from their files alone.

use std::path::Path;

use serde_json::Value;

use super::integrals::Values;
use super::rounds::{Whose, all_rounds};
use super::{Plan, blocks_of, digest, memory_of, summed_in};
use crate::blocks::{Node, PairwiseSum, Part};
use crate::error::{Error, Result};
use crate::image::Channel;
use crate::points::GatherPoint;
use crate::quantity::Quantity;
use crate::scene::Scene;
use crate::settings::Settings;

/// Parts of one bake put together. All come from one renderer, any.
pub struct Merge {
    job: Value,
    settings: Settings,
    plan: Plan,
    points: usize,
    summed: super::Summed,
}

impl Merge {
    /// Of the bake that `part`, read from `path`, is of; nothing yet.
    ///
    /// # Errors
    /// [`Error::Input`] when it is damaged.
    pub fn new(path: &Path, part: &Part) -> Result<Self> {
        let damaged = || Error::input(path, None, "damaged: it does not say what it is of", "make it again");
        let settings: Settings = serde_json::from_value(part.job["settings"].clone()).map_err(|_| damaged())?;
        let plan: Plan = serde_json::from_value(part.job["plan"].clone()).map_err(|_| damaged())?;
        let points = part.state["points"].as_u64().ok_or_else(damaged)? as usize;
        Ok(Self { job: part.job.clone(), settings, plan, points, summed: Default::default() })
    }

    /// # Errors
    /// [`Error::Input`] when it is of another bake or damaged, or has blocks that are there already.
    pub fn add(&mut self, path: &Path, part: &Part) -> Result<()> {
        part.check(path, &self.job)?;
        let plan = Plan { memory: memory_of(path, part)?, ..self.plan.clone() };
        let blocks = blocks_of(&self.settings);
        let (mut values, mut irradiance): (Vec<Node<Values>>, _) = (Vec::new(), Vec::new());
        let all = all_rounds(&plan, &self.settings, Whose::Receivers, [1, self.points]);
        for (number, round) in all.iter().enumerate().filter(|(_, round)| round.last) {
            let own = summed_in(path, part, number, round.points.len(), &plan.wanted(true), blocks)?;
            let same = values.iter().map(Node::range).eq(own.values.nodes().iter().map(Node::range));
            if irradiance.is_empty() {
                values = own.values.into_nodes();
            } else if same {
                values.iter_mut().zip(own.values.nodes()).for_each(|(node, further)| node.sum.append(&further.sum));
            } else {
                let problem = "not complete: some points are further than others";
                return Err(Error::input(path, None, problem, "run its shard again with --resume"));
            }
            irradiance.extend(own.irradiance);
        }
        let mut sum = PairwiseSum::default();
        values.into_iter().for_each(|node| sum.insert(node).unwrap_or_else(|_| unreachable!("nodes of a tree")));
        blocks.merge(path, &mut self.summed.values, sum)?;
        self.summed.irradiance = irradiance;
        Ok(())
    }

    /// # Errors
    /// [`Error::Usage`] that names the directions that no part has.
    pub fn check_whole(&self) -> Result<()> {
        blocks_of(&self.settings).check_whole(&self.summed.values)
    }

    /// # Errors
    /// [`Error::Input`] that names what differs.
    pub fn check_scene(&self, path: &Path, scene: &Scene, points: &[GatherPoint]) -> Result<()> {
        let mut job = self.job.clone();
        [job["scene"], job["points"]] = digest(scene, points);
        Part::new(self.job.clone(), Value::Null).check(path, &job)
    }

    /// # Errors
    /// As [`Self::check_whole`].
    pub fn columns(&self, points: &[GatherPoint]) -> Result<(Vec<Channel>, Vec<f32>)> {
        self.check_whole()?;
        let values = self.summed.values.total().unwrap_or_default();
        let columns = |&quantity: &Quantity| values.columns(quantity, self.plan.order, points, &self.summed.irradiance);
        Ok((self.plan.what.iter().flat_map(columns).collect(), values.inside()))
    }

    pub fn job(&self) -> &Value {
        &self.job
    }

    pub fn settings(&self) -> &Settings {
        &self.settings
    }
}
