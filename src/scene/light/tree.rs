//! A tree over many lamps. A point descends it to one of them, by about what each branch could bring there (Conty Estévez and Kulla 2018, "Importance
//! sampling of many lights with adaptive tree splitting"). So the cost of a sample grows with the depth of the tree, not with the number of lamps.
//!
//! What a branch could bring is its power times bounds of the two cosines, over the squared distance. It is 0 only where no lamp of the branch can shine,
//! so a sample's light over its probability has the right mean. The twin of `glsl/include/light_tree.glsl`.

use std::f32::consts::{FRAC_PI_2, PI};

use glam::{Vec3, Vec4};

use crate::math::Aabb;

/// Intervals along an axis at whose borders a branch may be divided.
const BINS: usize = 12;
/// Numbers in a descent stay below 1.
const BELOW_ONE: f32 = 1.0 - f32::EPSILON / 2.0;

/// A tree over lamps.
pub struct LightTree {
    /// The root first. The two children of a node follow each other.
    nodes: Vec<LightNode>,
}

/// A lamp, or what the lamps of a branch have in common.
#[derive(Clone, Copy)]
pub struct Branch {
    pub bounds: Aabb,
    /// Unit axis of a cone that holds all normals of emitting sides.
    pub axis: Vec3,
    /// Half angle of the cone, up to π.
    pub spread: f32,
    pub power: f64,
}

#[derive(Clone, Copy, Debug)]
struct LightNode {
    /// A sphere about the lamps: centre and radius.
    sphere: Vec4,
    /// The cone of normals: axis, and the cosine of its half angle.
    cone: Vec4,
    /// The share of the power of all lamps.
    power: f32,
    /// Index of the first child, or -1 less the index of the lamp.
    link: i32,
}

impl Branch {
    fn union(self, other: Self) -> Self {
        let (axis, spread) = union_of_cones((self.axis, self.spread), (other.axis, other.spread));
        let bounds = Aabb { min: self.bounds.min.min(other.bounds.min), max: self.bounds.max.max(other.bounds.max) };
        Self { bounds, axis, spread, power: self.power + other.power }
    }

    /// The cost of a branch: power, times the size of the sphere, times the directions into which its lamps shine.
    fn cost(&self) -> f64 {
        let (spread, reach) = (self.spread, (self.spread + FRAC_PI_2).min(PI));
        let directions = 4.0 * (1.0 - spread.cos())
            + (2.0 * reach * spread.sin() - (spread - 2.0 * reach).cos() - 2.0 * spread * spread.sin() + spread.cos());
        self.power * f64::from(self.bounds.diagonal().powi(2) * directions)
    }

    fn node(&self, total: f64, link: i32) -> LightNode {
        let radius = 0.5 * self.bounds.diagonal();
        LightNode {
            // The rounding of the centre must not leave a lamp outside.
            sphere: self.bounds.center().extend(radius * 1.000_01 + 1e-7),
            cone: self.axis.extend(self.spread.cos()),
            power: (self.power / total) as f32,
            link,
        }
    }
}

/// The least cone about two cones, or one near it. Each is an axis and a half angle.
fn union_of_cones(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let between = a.0.angle_between(b.0);
    let (a, b) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    if between + b.1 <= a.1 {
        return a;
    }
    let spread = 0.5 * (a.1 + between + b.1);
    let across = a.0.cross(b.0).normalize_or_zero();
    if spread >= PI || across == Vec3::ZERO {
        return (a.0, if between < FRAC_PI_2 { spread } else { PI });
    }
    let (sin, cos) = (spread - a.1).sin_cos();
    // Rounding of angles must not leave a normal outside.
    ((a.0 * cos + across.cross(a.0) * sin).normalize(), (spread + 1e-3).min(PI))
}

impl LightTree {
    /// # Panics
    /// When there are fewer than two lamps.
    pub fn new(lamps: &[Branch]) -> Self {
        assert!(lamps.len() > 1, "a tree divides lamps");
        let total = lamps.iter().map(|lamp| lamp.power).sum();
        let mut order: Vec<u32> = (0..lamps.len() as u32).collect();
        let mut tree = Self { nodes: Vec::with_capacity(2 * lamps.len()) };
        tree.nodes.push(lamps[0].node(total, 0));
        tree.divide(0, lamps, &mut order, total);
        tree
    }

    /// Makes the node at `index` and those below it.
    fn divide(&mut self, index: usize, lamps: &[Branch], order: &mut [u32], total: f64) {
        let branch = union(lamps, order).expect("a node has a lamp");
        if let [lamp] = *order {
            self.nodes[index] = branch.node(total, -1 - lamp as i32);
            return;
        }
        let middle = division(lamps, order);
        let first = self.nodes.len();
        self.nodes[index] = branch.node(total, first as i32);
        self.nodes.extend([self.nodes[index]; 2]);
        let (below, above) = order.split_at_mut(middle);
        self.divide(first, lamps, below, total);
        self.divide(first + 1, lamps, above, total);
    }

    /// Chooses a lamp for a receiver at `position` with the unit normal `normal`, by a uniform number. Returns its index, its probability, and a new
    /// uniform number from the rest of the given one. `None`: no lamp of the branch that the number leads to shines there.
    pub fn descend(&self, position: Vec3, normal: Vec3, number: f32) -> Option<(usize, f32, f32)> {
        let (mut left, mut probability, mut link) = (number, 1.0, self.nodes[0].link);
        while link >= 0 {
            let [one, other] = [0, 1].map(|child| &self.nodes[link as usize + child]);
            let [brings, all] = [one.could_bring(position, normal), other.could_bring(position, normal)];
            let all = brings + all;
            if all <= 0.0 {
                return None;
            }
            let share = brings / all;
            let takes = left < share;
            let chance = if takes { share } else { 1.0 - share };
            left = (if takes { left } else { left - share } / chance).min(BELOW_ONE);
            probability *= chance;
            link = if takes { one } else { other }.link;
        }
        Some(((-1 - link) as usize, probability, left))
    }

    /// The nodes as `glsl/include/light_tree.glsl` reads them, four texels each: sphere, cone, power with link, nothing.
    pub fn texels(&self) -> Vec<[f32; 4]> {
        let texels =
            |node: &LightNode| [node.sphere.to_array(), node.cone.to_array(), [node.power, node.link as f32, 0.0, 0.0], [0.0; 4]];
        self.nodes.iter().flat_map(texels).collect()
    }
}

impl LightNode {
    /// A bound of the light that a receiver could have, up to a factor that all nodes share.
    fn could_bring(&self, position: Vec3, normal: Vec3) -> f32 {
        let way = self.sphere.truncate() - position;
        let (squared, size) = (way.length_squared(), self.sphere.w * self.sphere.w);
        // Of the half angle that the sphere subtends.
        let cosine = if squared > size { (1.0 - size / squared).sqrt() } else { -1.0 };
        let direction = way / squared.max(1e-20).sqrt();
        let sends = cosine_less(cosine_less(-self.cone.truncate().dot(direction), self.cone.w), cosine);
        let receives = cosine_less(normal.dot(direction), cosine);
        self.power * sends.max(0.0) * receives.max(0.0) / squared.max(size)
    }
}

/// The cosine of the difference of two angles from 0 to π, given by their cosines; 1 if the second is greater.
fn cosine_less(a: f32, b: f32) -> f32 {
    if a > b { 1.0 } else { a * b + ((1.0 - a * a).max(0.0) * (1.0 - b * b).max(0.0)).sqrt() }
}

fn union(lamps: &[Branch], of: &[u32]) -> Option<Branch> {
    of.iter().map(|&lamp| lamps[lamp as usize]).reduce(Branch::union)
}

/// Sorts lamps into two parts of little cost. Returns the length of the first.
fn division(lamps: &[Branch], order: &mut [u32]) -> usize {
    let center = |lamp: u32| lamps[lamp as usize].bounds.center();
    let bounds = Aabb::from_points(order.iter().map(|&lamp| center(lamp)));
    let bin = |lamp: u32, axis: usize| {
        let place = (center(lamp)[axis] - bounds.min[axis]) / bounds.extent()[axis].max(f32::MIN_POSITIVE);
        ((place * BINS as f32) as usize).min(BINS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| bounds.extent()[axis] > 0.0) {
        let mut bins = [None::<Branch>; BINS];
        for &lamp in &*order {
            let of = &mut bins[bin(lamp, axis)];
            *of = join(*of, Some(lamps[lamp as usize]));
        }
        // Long thin branches cost more.
        let slimness = f64::from(bounds.extent().max_element() / bounds.extent()[axis]);
        let mut above = [None; BINS];
        (0..BINS - 1).rev().for_each(|bin| above[bin] = join(above[bin + 1], bins[bin + 1]));
        let mut below = None;
        for border in 0..BINS - 1 {
            below = join(below, bins[border]);
            if let (Some(below), Some(above)) = (below, above[border]) {
                let cost = slimness * (below.cost() + above.cost());
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, border));
                }
            }
        }
    }
    // Lamps at one place, such as the two sides of a triangle, have no border.
    let Some((_, axis, border)) = best else { return order.len() / 2 };
    order.sort_by_key(|&lamp| bin(lamp, axis) > border);
    order.partition_point(|&lamp| bin(lamp, axis) <= border)
}

fn join(a: Option<Branch>, b: Option<Branch>) -> Option<Branch> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(b)),
        (a, b) => a.or(b),
    }
}
