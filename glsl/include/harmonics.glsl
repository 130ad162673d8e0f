// Real spherical harmonics of ORDER bands: orthonormal, without the Condon-Shortley phase, coefficient l(l+1)+m. Mirrors src/harmonics.rs.

#define COEFFICIENTS (ORDER * ORDER)

void harmonics(vec3 direction, out float basis[COEFFICIENTS])
{
    float x = direction.x, y = direction.y, z = direction.z;
    float xx = x * x, yy = y * y, zz = z * z;
    basis[0] = 0.2820948;
#if ORDER > 1
    basis[1] = 0.4886025 * y;
    basis[2] = 0.4886025 * z;
    basis[3] = 0.4886025 * x;
#endif
#if ORDER > 2
    basis[4] = 1.0925484 * x * y;
    basis[5] = 1.0925484 * y * z;
    basis[6] = 0.31539157 * (3.0 * zz - 1.0);
    basis[7] = 1.0925484 * x * z;
    basis[8] = 0.5462742 * (xx - yy);
#endif
#if ORDER > 3
    basis[9] = 0.5900436 * y * (3.0 * xx - yy);
    basis[10] = 2.8906114 * x * y * z;
    basis[11] = 0.4570458 * y * (5.0 * zz - 1.0);
    basis[12] = 0.37317633 * z * (5.0 * zz - 3.0);
    basis[13] = 0.4570458 * x * (5.0 * zz - 1.0);
    basis[14] = 1.4453057 * z * (xx - yy);
    basis[15] = 0.5900436 * x * (xx - 3.0 * yy);
#endif
#if ORDER > 4
    basis[16] = 2.5033429 * x * y * (xx - yy);
    basis[17] = 1.7701308 * y * z * (3.0 * xx - yy);
    basis[18] = 0.9461747 * x * y * (7.0 * zz - 1.0);
    basis[19] = 0.6690465 * y * z * (7.0 * zz - 3.0);
    basis[20] = 0.10578555 * (35.0 * zz * zz - 30.0 * zz + 3.0);
    basis[21] = 0.6690465 * x * z * (7.0 * zz - 3.0);
    basis[22] = 0.47308735 * (xx - yy) * (7.0 * zz - 1.0);
    basis[23] = 1.7701308 * x * z * (xx - 3.0 * yy);
    basis[24] = 0.6258357 * (xx * (xx - 3.0 * yy) - yy * (3.0 * xx - yy));
#endif
}
