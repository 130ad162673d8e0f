//! Rasterises the points that a pinhole camera sees, one a pixel. Mirrors `glsl/visible_points.frag`.

use glam::camera::rh::{proj, view};
use glam::{Mat4, Vec2, Vec3, Vec4};
use rayon::prelude::*;

use super::{Ground, PointGloss, Points, Subset};
use crate::error::Result;
use crate::geometry::{Geometry, SurfacePass};
use crate::gpu::{DepthTest, Format, Gpu, Program, Target, Uniform};
use crate::scene::{Camera, Scene};
use crate::shaders;

/// Rasterises G-buffers of one picture size.
pub struct CameraPoints {
    program: Program,
    target: Target,
}

/// The G-buffer: the surface that each pixel sees, read back from the device, row by row from the bottom.
#[derive(Default)]
pub struct GBuffer {
    /// xyz: position in unit space; w as in [`Points`].
    pub position: Vec<Vec4>,
    /// xyz: unit shading normal on the visible side, zero where there is no point; w as in [`Points`].
    pub normal: Vec<Vec4>,
    /// rgb: albedo times the transmittance of mirrors and glass before the point; a: its triangle in the scene's mesh, counted from 1, or 0.
    pub albedo: Vec<Vec4>,
    /// rgb: emitted radiance, of the environment if the pixel sees no surface; a: distance of the first surface along the view axis, or 0.
    pub emission: Vec<Vec4>,
    /// The gloss of each pixel's point; empty if the scene has none. Albedo is then that of the base alone.
    pub gloss: Vec<PointGloss>,
    /// Number of pixels with a point: those that see a diffuse surface, or the ground.
    pub count: u32,
    /// Number of rays that ended at the limit of mirrors and glass.
    pub cut: u32,
}

impl CameraPoints {
    /// # Errors
    /// If the picture exceeds the device's limits.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self> {
        Ok(Self {
            program: Program::new(gpu, &shaders::VISIBLE_POINTS)?,
            target: Target::new(gpu, size, &[Format::Rgba32F; 4], true)?,
        })
    }

    /// Bytes that [`Self::new`] takes.
    pub fn bytes(size: [u32; 2]) -> usize {
        Target::bytes(size, &[Format::Rgba32F; 4], true)
    }

    /// Rasterises one point a pixel, at `offset`, in [0, 1)², from its lower left corner. `block` numbers the points of a pixel.
    pub fn see(&self, geometry: &Geometry, camera: &Camera, offset: Vec2, block: u32) -> GBuffer {
        self.see_into(GBuffer::default(), geometry, camera, offset, block)
    }

    /// The same, in the memory of another G-buffer.
    pub fn see_into(&self, spare: GBuffer, geometry: &Geometry, camera: &Camera, offset: Vec2, block: u32) -> GBuffer {
        let size = self.target.size().map(|side| side as f32);
        let forward = (camera.target - camera.eye).normalize();
        let (projection, near) = projection(camera, geometry, size[0] / size[1]);
        let uniforms = [
            ("eye", Uniform::Vec3(camera.eye)),
            ("forward", Uniform::Vec3(forward)),
            ("near", Uniform::Float(near)),
            ("picture_width", Uniform::Int(self.target.size()[0] as i32)),
        ];
        self.target.clear([0.0; 4], 0.0);
        let shift = (Vec2::splat(1.0) - 2.0 * offset) / Vec2::from(size);
        let to_clip = Mat4::from_translation(shift.extend(0.0)) * projection;
        geometry.draw(SurfacePass {
            target: &self.target,
            region: None,
            program: &self.program,
            of_cut_outs: |cut_outs| &cut_outs.visible_points,
            number: block,
            to_clip,
            depth: DepthTest::Greater,
            uniforms: &uniforms,
        });
        let GBuffer { mut position, mut normal, mut albedo, mut emission, .. } = spare;
        let columns = [&mut position, &mut normal, &mut albedo, &mut emission];
        columns.into_iter().enumerate().for_each(|(color, column)| self.target.color(color).read_into(column));
        let order = &geometry.order;
        let number = |(albedo, normal): (&mut Vec4, &Vec4)| {
            let seen = normal.truncate() != Vec3::ZERO;
            if seen {
                // A lost context reads what it likes.
                albedo.w = order.get(albedo.w as usize).map_or(0.0, |&triangle| (triangle + 1) as f32);
            }
            u32::from(seen)
        };
        let count = albedo.par_iter_mut().zip(&normal).map(number).sum();
        GBuffer { position, normal, albedo, emission, gloss: Vec::new(), count, cut: 0 }
    }

    /// The points of the last G-buffer, which is `g_buffer`, as gather points.
    pub fn points(&self, g_buffer: &GBuffer) -> Points<'_> {
        Points {
            position: self.target.color(0),
            normal: self.target.color(1),
            gloss: None,
            subset: Subset::ALL,
            count: g_buffer.count,
            identity: None,
        }
    }
}

impl GBuffer {
    /// Bytes of so many pixels.
    pub fn bytes(pixels: usize) -> usize {
        4 * size_of::<Vec4>() * pixels
    }

    /// Adds the environment to pixels that see no surface. `offset` is that of [`CameraPoints::see`].
    pub fn add_environment(&mut self, scene: &Scene, camera: &Camera, [width, height]: [u32; 2], offset: Vec2) {
        let Some(environment) = &scene.environment else { return };
        let look = |(i, (emission, normal)): (usize, (&mut Vec4, &Vec4))| {
            if normal.truncate() == Vec3::ZERO {
                *emission = environment.radiance(ray_of(i, camera, [width, height], offset)).extend(0.0);
            }
        };
        self.emission.par_iter_mut().zip(&self.normal).enumerate().for_each(look);
    }

    /// Multiplies emission by its pictures. The device has added the emission of the materials.
    pub fn add_pictures_of_emission(&mut self, scene: &Scene) {
        if !scene.has_pictures_of_emission() {
            return;
        }
        let look = |((emission, albedo), position): ((&mut Vec4, &Vec4), &Vec4)| {
            if albedo.w > 0.0 && emission.truncate() != Vec3::ZERO {
                let triangle = albedo.w as usize - 1;
                let barycentric = scene.mesh.barycentric(triangle, position.truncate());
                // Where the device sees emission, it sees the side that emits.
                *emission = scene.emission(triangle, barycentric, true).extend(emission.w);
            }
        };
        self.emission.par_iter_mut().zip(&self.albedo).zip(&self.position).for_each(look);
    }

    /// Adds points of the ground to pixels that see no surface, with the same `offset`.
    pub fn add_ground(&mut self, ground: &Ground, camera: &Camera, size: [u32; 2], offset: Vec2) {
        let Self { position, normal, emission, .. } = self;
        let look = |(i, ((position, normal), emission)): (usize, ((&mut Vec4, &mut Vec4), &Vec4))| {
            let sees = emission.w == 0.0;
            let met = sees.then(|| ground.met(camera.eye, ray_of(i, camera, size, offset))).flatten();
            let Some(place) = met else { return 0 };
            [*position, *normal] = ground.point(place);
            1
        };
        self.count += position.par_iter_mut().zip(normal).zip(&*emission).enumerate().map(look).sum::<u32>();
    }
}

/// The direction through pixel `i`, row by row from the bottom, at `offset` from its lower left corner.
fn ray_of(i: usize, camera: &Camera, [width, height]: [u32; 2], offset: Vec2) -> Vec3 {
    let size = Vec2::new(width as f32, height as f32);
    let from_below = (Vec2::new((i % width as usize) as f32, (i / width as usize) as f32) + offset) / size;
    camera.ray(Vec2::new(from_below.x, 1.0 - from_below.y), size.x / size.y)
}

/// Returns the matrix from unit space to clip space, and the distance of the near plane, which is too near to clip what a camera looks at.
///
/// The depth in clip space is the constant -near. So the near plane is exact, and no far plane can clip surfaces that rounding moves across
/// it. The shader computes the depth of the target, see `glsl/visible_points.frag`.
fn projection(camera: &Camera, geometry: &Geometry, aspect: f32) -> (Mat4, f32) {
    let view = view::look_at_mat4(camera.eye, camera.target, camera.up);
    let depths = geometry.positions.par_iter().map(|&position| -view.transform_point3(position).z);
    let farthest = depths.reduce(|| 0.0, f32::max).max(1e-3) * 1.001;
    let near = farthest * 1e-6;
    let mut projection = proj::opengl::perspective(camera.fov_y_degrees.to_radians(), aspect, near, farthest);
    (projection.z_axis.z, projection.w_axis.z) = (0.0, -near);
    (projection * view, near)
}
