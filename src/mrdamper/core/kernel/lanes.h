/* Several numbers at once, as wide as the instruction set has them; every lane gives the bits that one number gives.
 *
 * With a compiler that has no vector types a pack is one number.
 */
#ifndef MRD_LANES_H
#define MRD_LANES_H

#if !defined(__GNUC__)
#define PACK 1
typedef double pack;
#else
#if defined(__AVX512F__)
#define PACK 8
#elif defined(__AVX__)
#define PACK 4
#else
#define PACK 2
#endif
typedef double pack __attribute__((vector_size(PACK * sizeof(double)), aligned(sizeof(double)), may_alias));
#endif

#endif
