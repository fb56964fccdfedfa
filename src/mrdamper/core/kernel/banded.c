/* Symmetric positive definite systems of a narrow band, as least squares of splines have them. */

/* Solve A x = b in place, by A = L L': lower[d * n + j] = A[j + d][j] up to d = width becomes L, right becomes x.
 * 0 where A is not positive definite. */
static int banded_solve(size_t n, size_t width, double *lower, double *right)
{
    for (size_t j = 0; j < n; j++) {
        const size_t below = n - 1 - j < width ? n - 1 - j : width;
        if (!(lower[j] > 0.0)) return 0;
        const double root = sqrt(lower[j]);
        lower[j] = root;
        for (size_t d = 1; d <= below; d++) lower[d * n + j] /= root;
        right[j] /= root;
        for (size_t d = 1; d <= below; d++) {
            const double factor = lower[d * n + j];
            right[j + d] -= factor * right[j];
            for (size_t e = d; e <= below; e++) lower[(e - d) * n + j + d] -= lower[e * n + j] * factor;
        }
    }
    for (size_t j = n; j-- > 0;) {
        const size_t below = n - 1 - j < width ? n - 1 - j : width;
        for (size_t d = 1; d <= below; d++) right[j] -= lower[d * n + j] * right[j + d];
        right[j] /= lower[j];
    }
    return 1;
}
