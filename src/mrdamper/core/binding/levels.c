/* Select the build of the kernel for an instruction set level of x86-64. */
#include "interface.h"

const mrd_api *mrd_api_baseline(void);
#ifdef MRD_HAVE_X86_LEVELS
const mrd_api *mrd_api_v3(void);
const mrd_api *mrd_api_v4(void);

static int has_v3(void)
{
    __builtin_cpu_init();
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi2") && __builtin_cpu_supports("fma");
}

static int has_v4(void)
{
    return has_v3() && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
        && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512cd");
}
#endif

const mrd_api *mrd_level(int level)
{
    if (level == 0) return mrd_api_baseline();
#ifdef MRD_HAVE_X86_LEVELS
    if (level == 1 && has_v3()) return mrd_api_v3();
    if (level == 2 && has_v4()) return mrd_api_v4();
#endif
    return NULL;
}
