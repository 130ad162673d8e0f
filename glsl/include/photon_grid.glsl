// The grid photon map. Mirrors `PhotonTexture` in src/photon/texture.rs.
//
// Each cell has six bins, one for each dominant normal direction, in 3 x 2 tiles in x and y. A bin holds the photon flux (rgb) and the surface
// area (a) of the cell. The texture unit interpolates both; their quotient is the irradiance.

uniform sampler3D photon_grid;
uniform vec3 grid_origin;
uniform vec3 grid_cells;            // number of cells along each axis
uniform float grid_density;         // cells per unit of length

vec3 photon_irradiance(vec3 position, int axis, bool positive)
{
    int bin = 2 * axis + (positive ? 0 : 1);
    vec3 cell = clamp((position - grid_origin) * grid_density, vec3(0.75), grid_cells - 0.75);
    cell.xy += vec2(bin % 3, bin / 3) * grid_cells.xy;
    vec4 density = texture(photon_grid, cell / (grid_cells * vec3(3.0, 2.0, 1.0)));
    return density.a > 0.0 ? density.rgb / density.a : vec3(0.0);
}
