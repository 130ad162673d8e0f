//! The rest pose of a mesh: morphed by the weights of the file, and skinned by the joints where they stand.

use glam::{DAffine3, DMat3, DVec3, Vec3};

use super::accessors::AccessorValues;

/// How a mesh is bent.
#[derive(Default)]
pub struct Pose {
    /// Weights of the morph targets.
    pub weights: Vec<f32>,
    /// From the mesh to the world, for each joint; less `origin`.
    pub joints: Vec<DAffine3>,
    /// The place of a skinned mesh in the world, so that f32 holds its coordinates.
    pub origin: DVec3,
}

impl Pose {
    pub fn is_skinned(&self) -> bool {
        !self.joints.is_empty()
    }
}

/// The vertices of a primitive in a pose.
pub struct Posed<'a> {
    positions: AccessorValues<'a>,
    normals: Option<AccessorValues<'a>>,
    /// Weights, and differences of positions and normals.
    targets: Vec<(f32, [Option<AccessorValues<'a>>; 2])>,
    /// Joints and their weights, four in each.
    pub influences: Vec<(AccessorValues<'a>, AccessorValues<'a>)>,
    pose: &'a Pose,
}

impl<'a> Posed<'a> {
    pub fn new(positions: AccessorValues<'a>, normals: Option<AccessorValues<'a>>, pose: &'a Pose) -> Self {
        Self { positions, normals, targets: Vec::new(), influences: Vec::new(), pose }
    }

    pub fn count(&self) -> usize {
        self.positions.count
    }

    /// How many things bend a vertex.
    pub fn parts(&self) -> usize {
        self.targets.len() + self.influences.len()
    }

    /// Adds a morph target. Differences that are too few count for nothing.
    pub fn morph(&mut self, weight: f32, positions: Option<AccessorValues<'a>>, normals: Option<AccessorValues<'a>>) {
        if weight != 0.0 {
            let count = self.count();
            self.targets.push((weight, [positions, normals].map(|values| values.filter(|values| values.count >= count))));
        }
    }

    pub fn position(&self, vertex: usize) -> DVec3 {
        let position = self.morphed(&self.positions, 0, vertex);
        match self.skin(vertex) {
            Some(transform) => transform.transform_point3(position),
            None => position,
        }
    }

    /// Unit normal, or zero.
    pub fn normal(&self, vertex: usize) -> Vec3 {
        let Some(normals) = &self.normals else { return Vec3::ZERO };
        let normal = self.morphed(normals, 1, vertex);
        let normal = match self.skin(vertex) {
            Some(DAffine3 { matrix3: DMat3 { x_axis: x, y_axis: y, z_axis: z }, .. }) => {
                DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y)) * normal
            }
            None => normal,
        };
        normal.normalize_or_zero().as_vec3()
    }

    fn morphed(&self, values: &AccessorValues, kind: usize, vertex: usize) -> DVec3 {
        let at = |values: &AccessorValues| Vec3::from(values.get(vertex)).as_dvec3();
        let delta = |(weight, deltas): &(f32, [Option<AccessorValues>; 2])| {
            deltas[kind].as_ref().map_or(DVec3::ZERO, |deltas| f64::from(*weight) * at(deltas))
        };
        at(values) + self.targets.iter().map(delta).sum::<DVec3>()
    }

    /// The blended transform of the joints of a vertex.
    fn skin(&self, vertex: usize) -> Option<DAffine3> {
        if !self.pose.is_skinned() {
            return None;
        }
        let (mut blend, mut total) = (DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO }, 0.0);
        for (joints, weights) in &self.influences {
            for (joint, weight) in joints.get::<4>(vertex).into_iter().zip(weights.get::<4>(vertex)) {
                let Some(&DAffine3 { matrix3, translation }) = self.pose.joints.get(joint as usize).filter(|_| weight > 0.0)
                else {
                    continue;
                };
                let weight = f64::from(weight);
                total += weight;
                blend.matrix3 += weight * matrix3;
                blend.translation += weight * translation;
            }
        }
        // A vertex without weights stays with the first joint.
        match total {
            0.0 => self.pose.joints.first().copied(),
            _ => Some(DAffine3 { matrix3: blend.matrix3 / total, translation: blend.translation / total }),
        }
    }
}
