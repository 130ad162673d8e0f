//! The photon map on the GL side. Mirrors `glsl/include/photon_atlas.glsl` and `glsl/include/photon_grid.glsl`.

use glam::Vec3;

use super::atlas::{AtlasTables, PhotonAtlas};
use super::grid::{BINS, PhotonGrid};
use crate::error::Result;
use crate::gpu::{Format, Gpu, Texture, Uniform};
use crate::settings::PhotonMapKind;

/// A grid or an atlas in textures.
pub enum PhotonTexture {
    Atlas(AtlasTextures),
    Grid(GridTexture),
}

/// The tables of an atlas.
pub struct AtlasTextures {
    triangles: Texture,
    charts: Texture,
    pages: Texture,
    cells: Texture,
    irradiance: Texture,
}

/// A grid as a 3D texture. The six bins are tiles, three along x and two along y.
pub struct GridTexture {
    texture: Texture,
    origin: Vec3,
    cells: Vec3,
    density: f32,
}

impl PhotonTexture {
    /// # Errors
    /// [`crate::Error::Usage`] if the grid exceeds the device's limit for 3D textures.
    pub fn upload(gpu: &Gpu, grid: &PhotonGrid) -> Result<Self> {
        let [width, height, depth] = grid.cells.to_array().map(|side| side as usize);
        let mut texels = vec![[0.0f32; 4]; BINS * width * height * depth];
        // Shaders use flux over area, so the unit of area cancels. With a cell's face as the unit, numbers stay near 1.
        let unit = grid.cell_size.powi(-2);
        for (i, sums) in grid.sums.iter().enumerate() {
            let (x, y, z, bin) = (i % width, i / width % height, i / (width * height) % depth, i / (width * height * depth));
            let (column, row) = (bin % 3 * width + x, bin / 3 * height + y);
            texels[(z * 2 * height + row) * 3 * width + column] = sums.map(|sum| sum * unit);
        }
        let size = [3 * width, 2 * height, depth].map(|side| side as u32);
        let texture = Texture::from_texels_3d(gpu, Format::Rgba32F, size, &texels)?;
        let (origin, cells, density) = (grid.origin, grid.cells.as_vec3(), 1.0 / grid.cell_size);
        Ok(Self::Grid(GridTexture { texture, origin, cells, density }))
    }

    /// `order`: the triangles of the gathered mesh in the order of the shaders' table, see [`crate::geometry::Geometry::order`].
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the atlas exceeds the device's limits.
    pub fn of_atlas(gpu: &Gpu, atlas: &PhotonAtlas, order: &[usize]) -> Result<Self> {
        let AtlasTables { triangles, charts, pages, cells, irradiance } = atlas.tables(order);
        Ok(Self::Atlas(AtlasTextures {
            triangles: Texture::table(gpu, Format::R32Ui, triangles)?,
            charts: Texture::table(gpu, Format::Rgba32F, charts)?,
            pages: Texture::table(gpu, Format::R32Ui, pages)?,
            cells: Texture::table(gpu, Format::R32Ui, cells)?,
            irradiance: Texture::table(gpu, Format::Rgba32F, irradiance)?,
        }))
    }

    /// Replaces the irradiance of an atlas, after new photons. The surfaces stay.
    ///
    /// # Errors
    /// When the device has no memory left.
    pub fn renew(&mut self, gpu: &Gpu, atlas: &PhotonAtlas) -> Result<()> {
        if let Self::Atlas(textures) = self {
            textures.irradiance = Texture::table(gpu, Format::Rgba32F, atlas.irradiance_table())?;
        }
        Ok(())
    }

    pub fn kind(&self) -> PhotonMapKind {
        match self {
            Self::Atlas(_) => PhotonMapKind::Surface,
            Self::Grid(_) => PhotonMapKind::Grid,
        }
    }

    /// Bytes that [`Self::upload`] takes of a grid: the texture, and its texels meanwhile.
    pub fn bytes(cells: u32) -> usize {
        2 * PhotonGrid::bytes(cells)
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> Vec<(&'static str, Uniform<'_>)> {
        match self {
            Self::Atlas(AtlasTextures { triangles, charts, pages, cells, irradiance }) => vec![
                ("atlas_triangles", Uniform::Texture(triangles)),
                ("atlas_charts", Uniform::Texture(charts)),
                ("atlas_pages", Uniform::Texture(pages)),
                ("atlas_cells", Uniform::Texture(cells)),
                ("atlas_irradiance", Uniform::Texture(irradiance)),
            ],
            Self::Grid(GridTexture { texture, origin, cells, density }) => vec![
                ("photon_grid", Uniform::Texture(texture)),
                ("grid_origin", Uniform::Vec3(*origin)),
                ("grid_cells", Uniform::Vec3(*cells)),
                ("grid_density", Uniform::Float(*density)),
            ],
        }
    }
}
