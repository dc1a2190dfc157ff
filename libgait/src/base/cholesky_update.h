/* cholesky_update.h - the inner loop of factoring and forward substitution. Included once for each type:
 * NUMBER is the element, SIMD_F64S the register, UPDATE the name of the function. */

/* Columns [first, last) of rows i to i + 7: C = B + sign F'W, where F and W have `count` rows. If T, a block
 * on the diagonal of F, is given, the result is multiplied by T^-T. */
static void UPDATE(const NUMBER *B, NUMBER *C, int32_t ldc, int32_t i, int32_t first, int32_t last,
                   NUMBER sign, const NUMBER *F, int32_t ldf, const NUMBER *W, int32_t ldw, int32_t count,
                   const NUMBER *T)
{
    NUMBER corner[ROWS][ROWS];
    for (int32_t k = 0; T && k < ROWS; k++) {
        memcpy(corner[k], T + k * ldf, sizeof corner[k]);
        corner[k][k] = 1 / corner[k][k];
    }
    for (int32_t j = first; j < last; j += (int32_t)(sizeof(SIMD_F64S) / sizeof(NUMBER))) {
        size_t const at = (size_t)i * (size_t)ldc + (size_t)j;
        const NUMBER *const b = B + at;
        NUMBER *const c = C + at;
        const NUMBER *f = F + i, *w = W + j;
        SIMD_F64S a[ROWS];
        EACH_ROW(k) a[k] = sign * *(const SIMD_F64S *)(const void *)(b + k * ldc);
        for (int32_t r = 0; r < count; r++, f += ldf, w += ldw) {
            SIMD_F64S const x = *(const SIMD_F64S *)(const void *)w;
            EACH_ROW(k) a[k] += f[k] * x;
        }
        EACH_ROW(k) a[k] *= sign;
        __asm__(
            ""
            : "+m"(corner)); /* keeps the compiler from converting the whole block first, through memory */
        if (T)
            EACH_ROW(p)
            {
                a[p] *= corner[p][p];
                EACH_ROW(k) if (k > p) a[k] -= corner[p][k] * a[p];
            }
        EACH_ROW(k) * (SIMD_F64S *)(void *)(c + k * ldc) = a[k];
    }
}
