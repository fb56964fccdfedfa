/* Interface of a controller that is compiled with its tables. */
#include "controller.h"

mrd_real one_largest(void);
void one_start(mrd_track_state *s);
mrd_real one_step(mrd_track_state *s, const mrd_inputs *told);
