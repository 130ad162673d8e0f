//! Packets of shadow rays, of any direction. They take part in the search while nothing stops them.

use glam::{UVec2, Vec3, Vec3A};
use obvhs::cwbvh::node::CwBvhNode;
use obvhs::traverse;
use obvhs::triangle::Triangle;

use super::bvh::{Bvh, EDGE, Hit, SCALE};
use super::ray_packet::{LANES, Lanes, RayPacket, SLACK, code_of, greater, greatest, invertible, least, less, sides};

/// Shadow rays from the origins of a packet.
pub struct ShadowPacket<'a> {
    pub origins: &'a RayPacket,
    /// Unit vectors.
    pub directions: [Lanes; 3],
    /// The lengths of the rays, in unit space. 0 or less: no ray.
    pub reaches: Lanes,
}

/// What the packet knows while it goes through the tree.
struct ShadowSearch<'a> {
    rays: &'a ShadowPacket<'a>,
    inverses: [Lanes; 3],
    /// Bounds of the origins and of the inverses, over all rays. Along an axis where the signs of directions differ the inverses have none.
    origins: [[f32; 2]; 3],
    bounds: [Option<[f32; 2]>; 3],
    /// In the tree's units; -1 of rays that are stopped.
    reaches: Lanes,
    /// The greatest of them.
    reach: f32,
}

impl Bvh {
    /// Whether the rays of a packet reach their ends: a bit for each. With `CUT_OUTS`, `stops` is asked of hits, each of them once: whether nothing is left
    /// of the ray of a lane.
    ///
    /// Inlined, so that it is compiled for the vectors of the caller.
    #[inline(always)]
    pub fn reach_of_packet<const CUT_OUTS: bool>(&self, rays: &ShadowPacket, mut stops: impl FnMut(usize, Hit) -> bool) -> u32 {
        let mut search = ShadowSearch::new(rays);
        let order = Vec3A::from_array([0, 1, 2].map(|axis| rays.directions[axis][0]));
        let mut state = self.tree.new_traversal(order);
        let mut node;
        traverse!(self.tree, node, state, search.children(node, state.oct_inv4), {
            let leaf = state.primitive_id as usize;
            let triangle = self.tree.primitive_indices[leaf] as usize;
            search.meet::<CUT_OUTS>(&self.triangles[leaf], |lane, distance| stops(lane, Hit { triangle, distance }));
        });
        let mut reached = 0;
        for lane in 0..LANES {
            reached |= u32::from((search.reaches[lane] > 0.0) & (rays.reaches[lane] > 0.0)) << lane;
        }
        reached
    }
}

impl<'a> ShadowSearch<'a> {
    #[inline(always)]
    fn new(rays: &'a ShadowPacket<'a>) -> Self {
        let mut inverses = [[0.0; LANES]; 3];
        let reaches = rays.reaches.map(|reach| if reach > 0.0 { SCALE * reach } else { -1.0 });
        let (mut origins, mut bounds) = ([[0.0; 2]; 3], [None; 3]);
        for axis in 0..3 {
            let (mut low, mut high, mut negative) = ([f32::MAX; LANES], [-f32::MAX; LANES], 0);
            for lane in 0..LANES {
                let (inverse, is_ray) = (1.0 / invertible(rays.directions[axis][lane]), reaches[lane] > 0.0);
                inverses[axis][lane] = inverse;
                low[lane] = if is_ray { inverse } else { low[lane] };
                high[lane] = if is_ray { inverse } else { high[lane] };
                negative |= u32::from(is_ray & (inverse < 0.0)) | u32::from(is_ray & (inverse > 0.0)) << 1;
            }
            origins[axis] = rays.origins.bounds(axis);
            bounds[axis] = (negative != 3).then(|| [least(low), greatest(high)]);
        }
        let reach = greatest(reaches);
        Self { rays, inverses, origins, bounds, reaches, reach }
    }

    /// The children of a node that a ray meets, coded as the tree does it: as for parallel rays, but each with its own direction.
    #[inline(always)]
    fn children(&self, node: &CwBvhNode, order: u32) -> u32 {
        let (mut low, mut high) = ([[0.0; 8]; 3], [[0.0; 8]; 3]);
        let sides = sides(node);
        for axis in 0..3 {
            let step = f32::from_bits(u32::from(node.e[axis]) << 23);
            for child in 0..8 {
                low[axis][child] = f32::from(sides[axis][0][child]) * step + (node.p[axis] - SLACK);
                high[axis][child] = f32::from(sides[axis][1][child]) * step + (node.p[axis] + SLACK);
            }
        }
        let (mut near, mut far) = ([0.0; 8], [self.reach; 8]);
        for axis in 0..3 {
            let Some([slow, fast]) = self.bounds[axis] else { continue };
            let [first, last] = self.origins[axis];
            for child in 0..8 {
                // All rays go the same way. The box lies between these two ends of it, for the rays that are nearest to it and farthest.
                let (enter, leave) = match slow > 0.0 {
                    true => (low[axis][child] - last, high[axis][child] - first),
                    false => (high[axis][child] - first, low[axis][child] - last),
                };
                near[child] = greater(near[child], less(enter * slow, enter * fast));
                far[child] = less(far[child], greater(leave * slow, leave * fast));
            }
        }
        let mut left = 0;
        for child in 0..8 {
            left |= u32::from(near[child] <= far[child]) << child;
        }
        code_of(node, order, left, |child| {
            let mut met = 0;
            for lane in 0..LANES {
                let (mut near, mut far) = (0.0, self.reaches[lane]);
                for axis in 0..3 {
                    let (origin, inverse) = (self.rays.origins.scaled()[axis][lane], self.inverses[axis][lane]);
                    let (a, b) = ((low[axis][child] - origin) * inverse, (high[axis][child] - origin) * inverse);
                    near = greater(near, less(a, b));
                    far = less(far, greater(a, b));
                }
                met |= u32::from(near <= far);
            }
            met != 0
        })
    }

    /// Tests all rays against a triangle, as [`Bvh::nearest`] tests one.
    #[inline(always)]
    fn meet<const CUT_OUTS: bool>(&mut self, triangle: &Triangle, mut stops: impl FnMut(usize, f32) -> bool) {
        let corner = Vec3::from(triangle.v0);
        let (e1, e2) = (Vec3::from(triangle.v0 - triangle.v1), Vec3::from(triangle.v2 - triangle.v0));
        let normal = e1.cross(e2);
        let ([ox, oy, oz], [dx, dy, dz]) = (self.rays.origins.scaled(), &self.rays.directions);
        let mut any = 0;
        for lane in 0..LANES {
            let direction = Vec3::new(dx[lane], dy[lane], dz[lane]);
            let to_corner = Vec3::new(corner.x - ox[lane], corner.y - oy[lane], corner.z - oz[lane]);
            let across = direction.cross(to_corner);
            let scale = 1.0 / normal.dot(direction);
            let (u, v, distance) = (across.dot(e2) * scale, across.dot(e1) * scale, normal.dot(to_corner) * scale);
            let inside = (u >= -EDGE) & (v >= -EDGE) & (1.0 - u - v >= -EDGE);
            let mut met = inside & (distance >= 0.0) & (distance < self.reaches[lane]);
            if CUT_OUTS {
                met = met && stops(lane, distance / SCALE);
            }
            self.reaches[lane] = if met { -1.0 } else { self.reaches[lane] };
            any |= u32::from(met);
        }
        if any != 0 {
            self.reach = greatest(self.reaches);
        }
    }
}
