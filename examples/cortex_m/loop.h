/* What a board calls: loop_begin once, loop_step every millisecond, loop_end for what came out. */
#ifndef LOOP_H
#define LOOP_H

#include <stdint.h>

#define LOOP_SHOWN 4 /* bits of command, force and temperature; flags */

void loop_begin(void);
void loop_step(void);
void loop_end(uint32_t shown[LOOP_SHOWN]);

#endif
