//! Materials: reflection, refraction and emission of surfaces.

use glam::Vec3;

#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear reflectance in [0, 1], RGB; a texture multiplies it.
    pub albedo: Vec3,
    /// Radiance emitted from the front, RGB, W/(m² sr) in each channel.
    pub emission: Vec3,
    /// Whether the back emits as the front does.
    pub two_sided: bool,
    /// Index into the textures of the world or scene.
    pub albedo_texture: Option<usize>,
    pub surface: Surface,
    /// What its file says about it and pictures do not show, such as "roughness 0.2".
    pub unshaded: Vec<String>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            albedo: Self::GREY,
            emission: Vec3::ZERO,
            two_sided: false,
            albedo_texture: None,
            surface: Surface::Diffuse,
            unshaded: Vec::new(),
        }
    }
}

impl Material {
    /// Reflectance where a file gives none.
    pub const GREY: Vec3 = Vec3::splat(0.5);

    /// A surface whose picture of emission brings a mean radiance below this is no lamp: it has a few lights on black. Spread over the surface they would
    /// light nothing, and keep a scene from its sky.
    pub const LEAST_GLOW: f32 = 0.1;

    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// Radiance that the front or the back emits.
    pub fn emission_of(&self, front: bool) -> Vec3 {
        if front || self.two_sided { self.emission } else { Vec3::ZERO }
    }

    /// Whether it is a mirror or glass.
    pub fn is_specular(&self) -> bool {
        self.surface != Surface::Diffuse
    }

    pub fn is_glass(&self) -> bool {
        matches!(self.surface, Surface::Glass { .. })
    }
}

/// How a surface scatters light.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Surface {
    /// Lambertian reflection.
    #[default]
    Diffuse,
    /// Reflection in one direction. The albedo is the reflectance.
    Mirror,
    /// Reflection and refraction. The albedo is not used.
    Glass {
        /// Index of refraction behind the front, divided by the index before it.
        index: f32,
        /// Share of light that passes through a body, without the Fresnel terms. Each of its two faces applies the square root.
        filter: Vec3,
    },
}

impl Surface {
    /// Default index of refraction of glass.
    pub const GLASS_INDEX: f32 = 1.5;

    /// Returns itself, or the problem and its cure.
    pub fn check(self) -> Result<Self, (String, &'static str)> {
        match self {
            Self::Glass { index, .. } if !(1.0..=10.0).contains(&index) => {
                Err((format!("index of refraction is {index}"), "give a number from 1 to 10; glass has 1.5"))
            }
            Self::Glass { filter, .. } if !filter.to_array().iter().all(|share| (0.0..=1.0).contains(share)) => {
                Err((format!("filter is {filter}"), "give a share from 0 to 1 for each of red, green and blue"))
            }
            _ => Ok(self),
        }
    }
}
