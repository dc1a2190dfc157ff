#include "base/vec.h"

#include "check.h"

int main(void)
{
    const float a[3] = {1.0f, 2.0f, 3.0f}, b[3] = {-4.0f, 5.0f, 0.5f};
    const float m[9] = {1, 2, 3, 4, 5, 6, 7, 8, 10}, swapped[9] = {4, 5, 6, 1, 2, 3, 7, 8, 10};
    CHECK(v3_dot(a, b) == 7.5f && v3_dot(a, a) == 14.0f);
    CHECK(m3_det(m) == -3.0f && m3_det(swapped) == 3.0f);
    return CHECK_DONE();
}
