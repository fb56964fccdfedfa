/* Run the same loop on this machine without a timer. The board must print the same bits. */
#include <stdio.h>

#include "loop.h"

int main(void)
{
    uint32_t shown[LOOP_SHOWN];
    loop_begin();
    for (int i = 0; i < 3000; i++) loop_step();
    loop_end(shown);
    (void)printf("%08x %08x", 3000, 0);
    for (int i = 0; i < LOOP_SHOWN; i++) (void)printf(" %08lx", (unsigned long)shown[i]);
    (void)printf("\n");
    return 0;
}
