//! Tells a bake whose model is inside out, by a few rays from its points, before the gather gives nothing but black.

use glam::Vec3;

use crate::bake::Plan;
use crate::math::cosine_direction;
use crate::points::GatherPoint;
use crate::quantity::Quantity;
use crate::random::Random;
use crate::scene::{Bvh, Environment, RAY_OFFSET, Scene};

/// Points that are examined, and rays to each side of them.
const POINTS: usize = 256;
const RAYS: usize = 8;

/// The cure of all that is said here.
const CURE: &str = "if the model is inside out, turn it by --flip, or flip = true in a scene file";

/// What rays from the points meet, as shares.
#[derive(Default)]
struct Outlook {
    nothing: f32,
    backs: f32,
}

/// A warning if the points of the receiver `name` look into a model whose fronts are on the wrong side.
pub fn inside_out(name: &str, points: &[GatherPoint], scene: &Scene, bvh: &Bvh, plan: &Plan) -> Option<String> {
    let [front, back] = [1.0, -1.0].map(|side| look(points, scene, bvh, side));
    if front.backs > 0.6 && back.backs < 0.6 {
        return Some(format!("most of what {name} see are back sides; {CURE}"));
    }
    // A closed model with its fronts inside is a room if something shines in it, and then its openness alone is without sense.
    let is_open = |quantity: &Quantity| match quantity {
        Quantity::Ao | Quantity::BentNormal => plan.ao_distance.is_none(),
        Quantity::Sky | Quantity::Prt => true,
        _ => false,
    };
    let has_lamps = (0..scene.mesh.triangles.len()).any(|triangle| scene.material(triangle).is_emissive())
        || scene.lights.iter().any(|light| !light.is_directional());
    let sky_alone = !has_lamps && scene.environment.as_ref().is_some_and(|environment| !Environment::is_black(environment));
    let matters = sky_alone || plan.what.iter().any(is_open);
    (matters && front.nothing < 0.01 && back.nothing > 0.5).then(|| {
        format!("{name} see nothing of the outside, which lies behind their backs; {CURE}; in a room, limit ao by --ao-distance")
    })
}

/// Looks from the fronts (`side` 1) or backs (-1) of some of the points.
fn look(points: &[GatherPoint], scene: &Scene, bvh: &Bvh, side: f32) -> Outlook {
    let mut random = Random::new(0, 0);
    let mut seen = Outlook::default();
    let mut rays = 0.0_f32;
    for point in points.iter().step_by(points.len().div_ceil(POINTS).max(1)) {
        let [normal, surface] = [point.normal, point.surface_normal].map(|normal: Vec3| side * normal);
        for _ in 0..RAYS {
            let direction = cosine_direction(normal, random.uniform(), random.uniform());
            if surface.dot(direction) <= 0.0 {
                continue;
            }
            rays += 1.0;
            match bvh.nearest(point.position + RAY_OFFSET * surface, direction, None) {
                None => seen.nothing += 1.0,
                Some(hit) if scene.mesh.meets_front(hit.triangle, direction) => {}
                Some(_) => seen.backs += 1.0,
            }
        }
    }
    Outlook { nothing: seen.nothing / rays.max(1.0), backs: seen.backs / rays.max(1.0) }
}
