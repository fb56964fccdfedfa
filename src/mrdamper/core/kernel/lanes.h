/* The number type of the implicit laws: a `pack` is one double, or a vector of doubles of the width of the instruction
 * set. The bits of a lane do not depend on the width or on other lanes. The result of a candidate therefore does not
 * depend on the machine.
 *
 * Comparisons and selections are functions, so that a law is written once for all widths. A pack is one number if
 * MRD_ONE_LANE is defined, or if the compiler has no vector types. Its exp and ln are then those of the C library.
 */
#ifndef MRD_LANES_H
#define MRD_LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 8 /* number of lanes that are computed together, in LANES / PACK packs */

#if defined(MRD_ONE_LANE) || !defined(__GNUC__)
#define PACK 1
#define IN_LANES static inline
typedef double pack;
typedef double loose_pack;
typedef int pack_mask;
IN_LANES pack pack_of(double x) { return x; }
IN_LANES pack_mask is_less(pack a, pack b) { return a < b; }
IN_LANES pack_mask is_at_most(pack a, pack b) { return a <= b; }
IN_LANES pack_mask is_equal(pack a, pack b) { return a == b; }
IN_LANES pack_mask both(pack_mask a, pack_mask b) { return a && b; }
IN_LANES pack_mask either(pack_mask a, pack_mask b) { return a || b; }
IN_LANES pack_mask not_of(pack_mask a) { return !a; }
IN_LANES int any_of(pack_mask m) { return m; }
IN_LANES pack choose(pack_mask m, pack a, pack b) { return m ? a : b; }
IN_LANES pack only(pack_mask m, pack x) { return m ? x : 0.0; }
IN_LANES pack greater_of(pack a, pack b) { return a > b ? a : b; }
IN_LANES pack lesser_of(pack a, pack b) { return a < b ? a : b; }
IN_LANES pack signed_as(pack x, pack y) { return copysign(x, y); }
IN_LANES pack size_of(pack x) { return fabs(x); }
IN_LANES pack root_of(pack x) { return sqrt(x); }
IN_LANES pack exp_of(pack x) { return exp(x); }
IN_LANES pack log_of(pack x) { return log(x); }
#else

#if defined(__AVX512DQ__) && defined(__x86_64__)
#define PACK 8
#elif defined(__AVX__) && defined(__x86_64__)
#define PACK 4
#else
#define PACK 2
#endif
#if defined(__x86_64__)
#include <immintrin.h>
#endif
#define IN_LANES static inline __attribute__((always_inline, unused))

typedef double pack __attribute__((vector_size(PACK * sizeof(double))));
typedef int64_t pack_mask __attribute__((vector_size(PACK * sizeof(int64_t)))); /* -1: true, 0: false */
typedef uint64_t pack_bits __attribute__((vector_size(PACK * sizeof(uint64_t))));
typedef double loose_pack __attribute__((vector_size(PACK * sizeof(double)), aligned(sizeof(double)), may_alias));

IN_LANES pack pack_of(double x) { return x - (pack){0.0}; }
IN_LANES pack_mask is_less(pack a, pack b) { return (pack_mask)(a < b); }
IN_LANES pack_mask is_at_most(pack a, pack b) { return (pack_mask)(a <= b); }
IN_LANES pack_mask is_equal(pack a, pack b) { return (pack_mask)(a == b); }
IN_LANES pack_mask both(pack_mask a, pack_mask b) { return a & b; }
IN_LANES pack_mask either(pack_mask a, pack_mask b) { return a | b; }
IN_LANES pack_mask not_of(pack_mask a) { return ~a; }

/* Return m ? a : b. */
IN_LANES pack choose(pack_mask m, pack a, pack b)
{
#if PACK == 4
    return _mm256_blendv_pd(b, a, (__m256d)m);
#else
    return (pack)(((pack_mask)a & m) | ((pack_mask)b & ~m));
#endif
}

IN_LANES int any_of(pack_mask m)
{
#if PACK == 8
    return _mm512_movepi64_mask((__m512i)m) != 0;
#elif PACK == 4
    return _mm256_movemask_pd((__m256d)m) != 0;
#else
    return (m[0] | m[1]) != 0;
#endif
}

IN_LANES pack root_of(pack x)
{
#if PACK == 8
    return _mm512_sqrt_pd(x);
#elif PACK == 4
    return _mm256_sqrt_pd(x);
#else
    return (pack){sqrt(x[0]), sqrt(x[1])};
#endif
}

/* Return the greater and the lesser of two packs; b in lanes where a is NaN. */
IN_LANES pack greater_of(pack a, pack b)
{
#if PACK == 8
    return _mm512_max_pd(a, b);
#elif PACK == 4
    return _mm256_max_pd(a, b);
#else
    return choose((pack_mask)(a > b), a, b);
#endif
}

IN_LANES pack lesser_of(pack a, pack b)
{
#if PACK == 8
    return _mm512_min_pd(a, b);
#elif PACK == 4
    return _mm256_min_pd(a, b);
#else
    return choose((pack_mask)(a < b), a, b);
#endif
}

/* Return x in lanes where the mask is true, else 0. */
IN_LANES pack only(pack_mask m, pack x) { return (pack)((pack_mask)x & m); }

/* Return x with the sign of y, for x >= 0. */
IN_LANES pack signed_as(pack x, pack y) { return (pack)((pack_bits)x | ((pack_bits)y & UINT64_C(0x8000000000000000))); }

IN_LANES pack size_of(pack x) { return (pack)((pack_bits)x & UINT64_C(0x7fffffffffffffff)); }

/* Return exp(x) = 2^k exp(s), |s| <= ln 2 / 2, by the series up to s^13; error below 3e-16, minimum exp(-708). */
IN_LANES pack exp_of(pack x)
{
    const double whole = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to an integer, kept in the low bits */
    x = lesser_of(greater_of(x, pack_of(-708.0)), pack_of(709.0));
    const pack shifted = x * 1.44269504088896340736 + whole, k = shifted - whole;
    const pack s = (x - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    const pack s2 = s * s, s4 = s2 * s2, s8 = s4 * s4;
    const pack a = 0.5 + s * (1.0 / 6.0), b = 1.0 / 24.0 + s * (1.0 / 120.0);
    const pack c = 1.0 / 720.0 + s * (1.0 / 5040.0), d = 1.0 / 40320.0 + s * (1.0 / 362880.0);
    const pack e = 1.0 / 3628800.0 + s * (1.0 / 39916800.0), f = 1.0 / 479001600.0 + s * (1.0 / 6227020800.0);
    const pack tail = ((a + s2 * b) + s4 * (c + s2 * d)) + s8 * (e + s2 * f);
    const pack power = (pack)(((pack_bits)shifted + 1023u) << 52); /* 2^k */
    return power + power * (s + s2 * tail);
}

/* Return ln of positive normal numbers as k ln 2 + ln m, sqrt(1/2) <= m < sqrt(2). The error is below one unit of the
 * last digit. ln m is the polynomial in s = (m - 1) / (m + 1) of fdlibm's e_log.c (Sun Microsystems, 1993). */
IN_LANES pack log_of(pack x)
{
    const uint64_t half_root = UINT64_C(0x3fe6a09e667f3bcd); /* sqrt(1/2) */
    const pack_bits bits = (pack_bits)x + (UINT64_C(0x3ff0000000000000) - half_root);
    const pack k = (pack)((bits >> 52) | UINT64_C(0x4330000000000000)) - (4503599627370496.0 + 1023.0);
    const pack m = (pack)((bits & UINT64_C(0x000fffffffffffff)) + half_root);
    const pack f = m - 1.0, s = f / (2.0 + f), z = s * s, w = z * z, half = 0.5 * f * f;
    const pack odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01
                   + w * (1.818357216161805012e-01 + w * 1.479819860511658591e-01)));
    const pack even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01));
    return k * 6.93147180369123816490e-01 - ((half - (s * (half + (odd + even)) + k * 1.90821492927058770002e-10)) - f);
}

#endif

IN_LANES pack_mask is_positive(pack x) { return is_less(pack_of(0.0), x); }
IN_LANES int all_of(pack_mask m) { return !any_of(not_of(m)); }
IN_LANES int some_lane(pack x) { return !all_of(is_equal(x, pack_of(0.0))); }

#endif
