//! The photon grid on the GL side. Mirrors `glsl/include/photon_grid.glsl`.

use glam::Vec3;

use super::grid::{BINS, PhotonGrid};
use crate::error::Result;
use crate::gpu::{Format, Gpu, Texture, Uniform};

/// A grid as a 3D texture. The six bins are tiles, three along x and two along y.
pub struct PhotonTexture {
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
        Ok(Self { texture, origin: grid.origin, cells: grid.cells.as_vec3(), density: 1.0 / grid.cell_size })
    }

    /// Bytes that [`Self::upload`] takes of a grid: the texture, and its texels meanwhile.
    pub fn bytes(cells: u32) -> usize {
        2 * PhotonGrid::bytes(cells)
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 4] {
        [
            ("photon_grid", Uniform::Texture(&self.texture)),
            ("grid_origin", Uniform::Vec3(self.origin)),
            ("grid_cells", Uniform::Vec3(self.cells)),
            ("grid_density", Uniform::Float(self.density)),
        ]
    }
}
