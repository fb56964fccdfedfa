/* Which of the builds for x86-64 levels 3 and 4 this processor runs: 0 (neither), 1 (AVX2) or 2 (AVX-512). */
#ifndef MRD_LEVELS_H
#define MRD_LEVELS_H

static int x86_level(void)
{
#ifdef MRD_HAVE_X86_LEVELS
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma"))
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl")
                       && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd")
                   ? 2
                   : 1;
#endif
    return 0;
}

#endif
