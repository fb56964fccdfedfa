/* Interface of the control loop: call loop_begin once, loop_step every millisecond, then loop_end for the results. */
#ifndef LOOP_H
#define LOOP_H

#include <stdint.h>

#define LOOP_SHOWN 4 /* number of results: bits of current, force and temperature, then the flags */

void loop_begin(void);
void loop_step(void);
void loop_end(uint32_t shown[LOOP_SHOWN]);

#endif
