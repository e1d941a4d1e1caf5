"""Functions of generated code that are written by hand, by name."""

import re

SUPPORT = {
    "s_max": """
static inline float s_max(float a, float b) { return (a > b || a != a) ? a : b; }""",
    "s_min": """
static inline float s_min(float a, float b) { return (a < b || a != a) ? a : b; }""",
    "s_imax": """
static inline int32_t s_imax(int32_t a, int32_t b) { return a > b ? a : b; }""",
    "s_imin": """
static inline int32_t s_imin(int32_t a, int32_t b) { return a < b ? a : b; }""",
    "s_sign": """
static inline float s_sign(float a) { return (float)((a > 0.0f) - (a < 0.0f)); }""",
    "s_square": """
static inline float s_square(float a) { return a * a; }""",
    "s_power": """
static inline float s_power(float a, int n)
{
    float result = 1.0f;
    for (int i = 0; i < (n < 0 ? -n : n); i++) result *= a;
    return n < 0 ? 1.0f / result : result;
}""",
    "s_logistic": """
static inline float s_logistic(float a) { return 1.0f / (1.0f + expf(-a)); }""",
    "s_less": """
/* NaN is larger than every number */
static inline int s_less(float a, float b) { return a < b || (b != b && a == a); }""",
    "s_dot": """
/* eight sums side by side, which compilers turn into vector instructions */
static inline float s_dot(const float *a, const float *b, int n)
{
    float sums[8] = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    int i = 0;
    for (; i + 8 <= n; i += 8)
        for (int j = 0; j < 8; j++) sums[j] += a[i + j] * b[i + j];
    float rest = 0.0f;
    for (; i < n; i++) rest += a[i] * b[i];
    float low = (sums[0] + sums[1]) + (sums[2] + sums[3]);
    return rest + low + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
}""",
    "s_lu": """
/* LU factors with partial pivoting, in place; rows x columns, last axis fastest */
static void s_lu(float *a, int rows, int columns, int32_t *pivots, int32_t *order)
{
    int steps = rows < columns ? rows : columns;
    for (int i = 0; i < rows; i++) order[i] = i;
    for (int s = 0; s < steps; s++) {
        int best = s;
        for (int i = s + 1; i < rows; i++)
            if (fabsf(a[i * columns + s]) > fabsf(a[best * columns + s])) best = i;
        pivots[s] = best;
        if (best != s) {
            int32_t row = order[s];
            order[s] = order[best];
            order[best] = row;
            for (int j = 0; j < columns; j++) {
                float value = a[s * columns + j];
                a[s * columns + j] = a[best * columns + j];
                a[best * columns + j] = value;
            }
        }
        for (int i = s + 1; i < rows; i++) {
            float factor = a[i * columns + s] / a[s * columns + s];
            a[i * columns + s] = factor;
            for (int j = s + 1; j < columns; j++)
                a[i * columns + j] -= factor * a[s * columns + j];
        }
    }
}""",
    "s_triangular": """
/* Solve a x = b in place; element (i, j) of a is at i * ai + j * aj */
static void s_triangular(const float *a, int ai, int aj, float *b, int bi, int bj,
                         int size, int columns, int lower, int unit)
{
    for (int step = 0; step < size; step++) {
        int i = lower ? step : size - 1 - step;
        for (int c = 0; c < columns; c++) {
            float sum = b[i * bi + c * bj];
            for (int other = 0; other < step; other++) {
                int j = lower ? other : size - 1 - other;
                sum -= a[i * ai + j * aj] * b[j * bi + c * bj];
            }
            b[i * bi + c * bj] = unit ? sum : sum / a[i * ai + i * aj];
        }
    }
}""",
    "s_cholesky": """
/* Lower factor in place, zeros above; NaN where the matrix is not positive definite */
static void s_cholesky(float *a, int size)
{
    for (int j = 0; j < size; j++) {
        for (int i = 0; i < j; i++) a[i * size + j] = 0.0f;
        float sum = a[j * size + j];
        for (int k = 0; k < j; k++) sum -= a[j * size + k] * a[j * size + k];
        float root = sqrtf(sum);
        a[j * size + j] = root;
        for (int i = j + 1; i < size; i++) {
            float rest = a[i * size + j];
            for (int k = 0; k < j; k++) rest -= a[i * size + k] * a[j * size + k];
            a[i * size + j] = rest / root;
        }
    }
}""",
}


def support_for(text: str) -> str:
    """Definitions of the functions that a text calls."""
    used = set(re.findall(r"\bs_\w+(?=\()", text))
    return "\n".join(
        definition.strip() for name, definition in SUPPORT.items() if name in used
    )
