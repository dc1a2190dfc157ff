#include "vec.h"

#include "check.h"

int main(void)
{
    const float a[3] = {1.0f, 2.0f, 3.0f}, b[3] = {-4.0f, 5.0f, 0.5f};
    const float m[9] = {1, 2, 3, 4, 5, 6, 7, 8, 10};
    float v[3];
    v3_sub(v, a, b);
    CHECK(v[0] == 5.0f && v[1] == -3.0f && v[2] == 2.5f);
    v3_madd(v, a, 2.0f, b);
    CHECK(v[0] == -7.0f && v[1] == 12.0f && v[2] == 4.0f);
    CHECK(v3_dot(a, b) == 7.5f && v3_norm((float[3]){2, 3, 6}) == 7.0f);
    v3_cross(v, a, b);
    CHECK(v[0] == -14.0f && v[1] == -12.5f && v[2] == 13.0f);
    CHECK(v3_dot(v, a) == 0.0f && v3_dot(v, b) == 0.0f);
    m3_mul_v(v, m, a);
    CHECK(v[0] == 14.0f && v[1] == 32.0f && v[2] == 53.0f);
    m3_tmul_v(v, m, a);
    CHECK(v[0] == 30.0f && v[1] == 36.0f && v[2] == 45.0f);
    CHECK(m3_det(m) == -3.0f);
    return CHECK_DONE();
}
