//! Materials: reflection, refraction and emission of surfaces.

use glam::Vec3;

use super::ImageTexture;

#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    pub name: String,
    /// Linear reflectance in [0, 1], RGB; a texture multiplies it.
    pub albedo: Vec3,
    /// Radiance emitted from the front, RGB, W/(m² sr) in each channel; a texture multiplies it.
    pub emission: Vec3,
    /// Whether the back emits as the front does.
    pub two_sided: bool,
    /// Index into the textures of the world or scene, as in the other textures here.
    pub albedo_texture: Option<usize>,
    /// A picture whose linear colours multiply the emission.
    pub emission_texture: Option<usize>,
    pub opacity: Opacity,
    /// `None`: Lambertian.
    pub gloss: Option<Gloss>,
    pub normal_map: Option<NormalMap>,
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
            emission_texture: None,
            opacity: Opacity::default(),
            gloss: None,
            normal_map: None,
            surface: Surface::Diffuse,
            unshaded: Vec::new(),
        }
    }
}

impl Material {
    /// Reflectance where a file gives none.
    pub const GREY: Vec3 = Vec3::splat(0.5);

    /// A surface whose picture of emission brings a mean radiance below this is no lamp. A few lights on black show, but light too little to keep a scene
    /// from its sky.
    pub const LEAST_GLOW: f32 = 0.1;

    /// Whether shaders read the texture with this index. Gloss and normal maps are read on the CPU.
    pub fn is_in_shaders(&self, texture: usize) -> bool {
        [self.albedo_texture, self.emission_texture, self.opacity.texture].contains(&Some(texture))
    }

    pub fn is_emissive(&self) -> bool {
        self.emission != Vec3::ZERO
    }

    /// The mean of the emission over the picture that multiplies it, one of `textures`.
    pub fn mean_emission(&self, textures: &[ImageTexture]) -> Vec3 {
        self.emission * self.emission_texture.map_or(Vec3::ONE, |texture| textures[texture].mean_linear())
    }

    /// Whether it lights a scene, rather than being a surface with a few lights on it.
    fn is_lamp(&self, textures: &[ImageTexture]) -> bool {
        self.is_emissive() && (self.emission_texture.is_none() || self.mean_emission(textures).max_element() >= Self::LEAST_GLOW)
    }

    /// The same of each of these materials.
    pub fn are_lamps(materials: &[Self], textures: &[ImageTexture]) -> Vec<bool> {
        materials.iter().map(|material| material.is_lamp(textures)).collect()
    }

    /// Radiance that the front or the back emits, without the texture, which multiplies it.
    pub fn emission_of(&self, front: bool) -> Vec3 {
        if front || self.two_sided { self.emission } else { Vec3::ZERO }
    }

    /// The gloss, to be changed.
    pub fn own_gloss(&mut self) -> &mut Gloss {
        self.gloss.get_or_insert_default()
    }

    /// Whether it is a mirror or glass.
    pub fn is_specular(&self) -> bool {
        self.surface != Surface::Diffuse
    }

    pub fn is_glass(&self) -> bool {
        matches!(self.surface, Surface::Glass { .. })
    }
}

/// How much of the light a surface stops, without glass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Opacity {
    /// From 0 to 1; a texture multiplies it.
    pub share: f32,
    /// A picture whose alpha multiplies the share.
    pub texture: Option<usize>,
    /// What is less opaque is not there, and all else is opaque. `None`: the share of the light that the surface stops.
    pub cutoff: Option<f32>,
}

impl Opacity {
    /// Whether it may let light pass.
    pub fn is_partial(&self) -> bool {
        let least = self.cutoff.unwrap_or(1.0);
        least > 0.0 && (self.texture.is_some() || self.share < least)
    }

    /// Opacity where the texture has this alpha.
    pub fn at(&self, alpha: f32) -> f32 {
        let opacity = self.share * alpha;
        match self.cutoff {
            Some(cutoff) if opacity >= cutoff => 1.0,
            Some(_) => 0.0,
            None => opacity,
        }
    }
}

impl Default for Opacity {
    fn default() -> Self {
        Self { share: 1.0, texture: None, cutoff: None }
    }
}

/// A rough reflection over a diffuse base: metallic-roughness, as glTF 2.0 defines it in its appendix B.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gloss {
    /// From 0 to 1. The width α of the GGX distribution is its square. The texture's green multiplies it.
    pub roughness: f32,
    /// 1 is a metal, whose reflectance is the albedo; 0 is a dielectric. The texture's blue multiplies it.
    pub metallic: f32,
    /// Reflectance of a dielectric straight on; 0.04 has an index of refraction of 1.5.
    pub specular: Vec3,
    /// A picture of linear values.
    pub texture: Option<usize>,
}

impl Gloss {
    /// Reflectance straight on of an index of refraction of 1.5.
    pub const SPECULAR: f32 = 0.04;
}

/// A rough dielectric.
impl Default for Gloss {
    fn default() -> Self {
        Self { roughness: 1.0, metallic: 0.0, specular: Vec3::splat(Self::SPECULAR), texture: None }
    }
}

/// Normals in the frame of a texture, which turn the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NormalMap {
    /// A picture of linear values: x, y and z from 0 to 1 stand for -1 to 1; y runs up, as v.
    pub texture: usize,
    /// Multiplies x and y.
    pub scale: f32,
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
