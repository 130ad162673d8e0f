//! Gathers irradiance from the photon map, by any pipeline. Mirrors `glsl/consumer/irradiance.glsl`.
//!
//! [`Pipeline::Raycast`] uses no shader: [packets](crate::points::packets) of rays find hits, and the oracle looks up their radiance. So drivers add no rounding,
//! such as that of their texture decoding (6e-5 of a textured picture's mean on llvmpipe).

use std::rc::Rc;

use glam::{Vec3, Vec4};

use super::{GatherPass, HitFinder, MissRadiance, hit_finder, shader_of};
use crate::direction::Direction;
use crate::error::Result;
use crate::geometry::Geometry;
use crate::gpu::Gpu;
use crate::photon::PhotonTexture;
use crate::points::packets::{Ends, PacketConsumer, PointHits, PointPacket, SubsetPackets, cast, put_in_order};
use crate::points::{Accumulator, GatherPoint, Interleave, PointGloss, Points};
use crate::reference::Reference;
use crate::scene::{Bvh, LANES, Lanes, Scene, of_lane};
use crate::settings::{Pipeline, Settings};
use crate::shaders::{BATCH, Consumer, HitRadiance};

/// Inputs of [`IrradianceGather::add`].
#[derive(Clone, Copy)]
pub struct GatherInputs<'a> {
    /// In unit space.
    pub scene: &'a Scene,
    pub geometry: &'a Geometry,
    pub photons: &'a PhotonTexture,
    /// Of the same scene and photons.
    pub oracle: Reference<'a>,
    pub points: Points<'a>,
}

/// Sums over directions at each point. rgb: Σ radiance × weight; a: Σ weight.
pub struct IrradianceGather {
    interleave: Interleave,
    method: Method,
}

enum Method {
    Shader {
        finder: Box<dyn HitFinder>,
        pass: GatherPass,
        sums: Accumulator,
    },
    Packets {
        subsets: Vec<PacketSubset>,
        /// The gloss of each point, row by row from the bottom. Empty without gloss.
        gloss: Vec<PointGloss>,
        /// Number of points, with those that are none.
        places: usize,
    },
}

/// The points of one subset in packets, with their sums.
struct PacketSubset {
    packets: Vec<PointPacket>,
    sums: Vec<PacketSums>,
}

/// The sums of each point of a packet.
#[derive(Clone)]
struct PacketSums {
    /// Red, green, blue and weight.
    sums: [Lanes; 4],
    /// As [`IrradianceGather::read_lobes`]; `None` without gloss.
    lobes: Option<Box<[[Vec4; 2]; LANES]>>,
}

impl IrradianceGather {
    /// Uses the settings' pipeline, its photon map, and point textures of `interleave`. `scene` is in unit space, `bvh` of its mesh.
    ///
    /// # Errors
    /// When a size is beyond the device's limits.
    pub fn new(gpu: &Gpu, settings: &Settings, scene: &Scene, bvh: &Rc<Bvh>, interleave: Interleave) -> Result<Self> {
        Self::with(gpu, settings, (scene, bvh), interleave, false)
    }

    /// The same for points with gloss, if `glossy` is true.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with(
        gpu: &Gpu,
        settings: &Settings,
        (scene, bvh): (&Scene, &Rc<Bvh>),
        interleave: Interleave,
        glossy: bool,
    ) -> Result<Self> {
        let method = match settings.gather.pipeline {
            Pipeline::Raycast => Method::Packets { subsets: Vec::new(), gloss: Vec::new(), places: 0 },
            pipeline => {
                // The finder comes last: it adapts to the memory that is left.
                let sums = Accumulator::several(gpu, interleave.sums_size(), if glossy { 3 } else { 1 })?;
                let radiance = HitRadiance { source: settings.photons.map.into(), textured: scene.is_textured() };
                let consumer = if glossy { Consumer::Gloss(radiance) } else { Consumer::Irradiance(radiance) };
                let pass = GatherPass::new(gpu, shader_of(pipeline, scene), consumer)?;
                Method::Shader {
                    finder: hit_finder(gpu, &settings.gather, settings.layers(), scene, bvh, interleave.tile())?,
                    pass,
                    sums,
                }
            }
        };
        Ok(Self { interleave, method })
    }

    /// The most directions in a batch.
    pub fn batch(&self) -> usize {
        match &self.method {
            Method::Shader { finder, .. } => finder.batch(),
            Method::Packets { .. } => BATCH,
        }
    }

    /// As [`HitFinder::both_ends`].
    pub fn both_ends(&self) -> bool {
        match &self.method {
            Method::Shader { finder, .. } => finder.both_ends(),
            Method::Packets { .. } => true,
        }
    }

    /// As [`HitFinder::shrink`].
    pub fn shrink(&mut self) -> bool {
        match &mut self.method {
            Method::Shader { finder, .. } => finder.shrink(),
            Method::Packets { .. } => false,
        }
    }

    /// Clears the sums. `points` are all points, row by row from the bottom; layers and packets ask for them.
    pub fn begin(&mut self, points: &[Option<GatherPoint>]) {
        self.begin_glossy(points, &[], None);
    }

    /// The same for points with gloss, which only packets read here; empty without it. `packets`: the points in packets, if the caller has them. Those of
    /// other subsets are made anew.
    pub fn begin_glossy(&mut self, points: &[Option<GatherPoint>], of_points: &[PointGloss], packets: Option<SubsetPackets>) {
        match &mut self.method {
            Method::Shader { finder, sums, .. } => {
                finder.fit(&|| points.iter().flatten().map(|point| point.position).collect());
                sums.clear();
            }
            Method::Packets { subsets, gloss, places } => {
                let (size, stride) = self.interleave.squares();
                let same = packets.filter(|packets| packets.stride == stride);
                let packets = same.unwrap_or_else(|| SubsetPackets::of_picture(points, size, stride));
                let lobes = (!of_points.is_empty()).then(|| Box::new([[Vec4::ZERO; 2]; LANES]));
                let empty = PacketSums { sums: [[0.0; LANES]; 4], lobes };
                let subset = |packets: Vec<PointPacket>| PacketSubset { sums: vec![empty.clone(); packets.len()], packets };
                *subsets = packets.subsets.into_iter().map(subset).collect();
                (*gloss, *places) = (of_points.to_vec(), points.len());
            }
        }
    }

    /// Gathers along `directions` at the points of one subset. Returns the most layers peeled for a direction, 0 when the pipeline peels none.
    ///
    /// # Errors
    /// [`crate::Error::Gl`] when the device is too small for the scene.
    pub fn add(&mut self, inputs: GatherInputs, directions: &[Direction]) -> Result<u32> {
        let GatherInputs { scene, geometry, photons, oracle, points } = inputs;
        let (mut most, mut left) = (0, directions);
        match &mut self.method {
            Method::Shader { finder, pass, sums } => {
                while !left.is_empty() {
                    let begun = finder.begin(geometry, &left[..left.len().min(finder.batch())])?;
                    let (batch, later) = left.split_at(begun);
                    let miss = MissRadiance::new(scene, batch);
                    let found = finder.find(geometry, points)?;
                    let uniforms = [&geometry.uniforms()[..], &photons.uniforms(), &miss.uniforms()].concat();
                    pass.add(&found, points, sums, &uniforms);
                    (most, left) = (most.max(found.layers), later);
                }
            }
            Method::Packets { subsets, gloss, .. } => {
                let ends: Vec<Ends> = directions.iter().map(Ends::new).collect();
                let misses = ends.iter().map(|ends| ends.misses(scene)).collect();
                let PacketSubset { packets, sums } = &mut subsets[points.subset.index()];
                cast(oracle.rays(), packets, &ends, sums, &PacketGather { oracle, ends: &ends, misses, gloss });
            }
        }
        Ok(most)
    }

    /// Of points with gloss the sums of their lobes: rgb of the first is Σ radiance × weight, of the second Σ weight. `None` without gloss.
    pub fn read_lobes(&self) -> Option<[Vec<Vec4>; 2]> {
        match &self.method {
            Method::Shader { sums, .. } => {
                let mut lobes = sums.read_all().skip(1).map(|sums| self.interleave.in_order(sums));
                Some([lobes.next()?, lobes.next()?])
            }
            Method::Packets { gloss, .. } if gloss.is_empty() => None,
            Method::Packets { subsets, places, .. } => Some([0, 1].map(|part| {
                in_order(subsets, *places, |sums, lane| sums.lobes.as_ref().map_or(Vec4::ZERO, |lobes| lobes[lane][part]))
            })),
        }
    }

    /// The sums, row by row from the bottom.
    pub fn read(&self) -> Vec<Vec4> {
        match &self.method {
            Method::Shader { sums, .. } => self.interleave.in_order(sums.read()),
            Method::Packets { subsets, places, .. } => {
                in_order(subsets, *places, |sums, lane| Vec4::from(of_lane(&sums.sums, lane)))
            }
        }
    }
}

/// Adds what packets see along some directions.
struct PacketGather<'a> {
    oracle: Reference<'a>,
    ends: &'a [Ends],
    /// The radiance of rays without a hit, along and against each direction.
    misses: Vec<[Vec3; 2]>,
    /// The gloss of each point, row by row from the bottom. Empty without gloss.
    gloss: &'a [PointGloss],
}

impl PacketConsumer for PacketGather<'_> {
    type Sums = PacketSums;

    #[inline(always)]
    fn take(&self, packet: &PointPacket, PacketSums { sums, lobes }: &mut PacketSums, direction: usize, found: &PointHits) {
        let radiosities = self.oracle.radiosities(&found.hits, &found.positions);
        let (radiance, weights) = (found.radiance(radiosities, self.misses[direction]), found.counted_weights());
        let Some(lobes) = lobes else {
            for lane in 0..LANES {
                for color in 0..3 {
                    sums[color][lane] += weights[lane] * radiance[color][lane];
                }
                sums[3][lane] += weights[lane];
            }
            return;
        };
        for lane in (0..LANES).filter(|lane| found.counting >> lane & 1 == 1) {
            let (radiance, weight) = (Vec3::from(of_lane(&radiance, lane)), weights[lane]);
            let vector = self.ends[direction].vector(found.against >> lane & 1 == 1);
            let of_lobes = self.gloss[packet.points()[lane] as usize].weights(packet.normal(lane), vector);
            let lobe = weight * of_lobes.lobe;
            let base = weight * of_lobes.base * radiance.extend(1.0);
            sums.iter_mut().zip(base.to_array()).for_each(|(sums, base)| sums[lane] += base);
            lobes[lane][0] += (radiance * lobe).extend(0.0);
            lobes[lane][1] += lobe.extend(0.0);
        }
    }
}

/// A value of each point's sums, in the order of the points.
fn in_order(subsets: &[PacketSubset], places: usize, value: impl Fn(&PacketSums, usize) -> Vec4) -> Vec<Vec4> {
    let mut values = vec![Vec4::ZERO; places];
    put_in_order(subsets.iter().flat_map(|subset| subset.packets.iter().zip(&subset.sums)), &mut values, value);
    values
}
