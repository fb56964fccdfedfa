/* What of the virtual damper depends on temperature and the step alone; its steps are in plant_lanes.c. */
#include "plant.h"

#include <math.h>

static const double room = 293.15; /* 20 C, where the parameters hold [K] */

void rig_settle(const rig_parameters *p, double step, double kelvin, rig_climate *at)
{
    const double warmer = kelvin - room;
    const double quicker = 1.0 + p->eddy_per_K * warmer, ohm = p->coil_ohm * (1.0 + p->copper_per_K * warmer);
    const double friction = p->friction_N * (1.0 - p->friction_loss_per_K * warmer);
    at->siemens = 1.0 / ohm;
    at->coil_decay = -step * ohm / p->coil_henry;
    at->rise = exp(-step * quicker / p->eddy_rise_s);
    at->fall = exp(-step * quicker / p->eddy_fall_s);
    at->fluid = exp(-step / p->fluid_lag_s);
    at->per_field_A = 1.0 / p->field_current_A;
    at->full_log = log(tanh(p->full_current_A / p->field_current_A));
    at->viscous = p->viscous_N
                  * exp(p->viscosity_K * (1.0 / (kelvin - p->viscosity_pole_K) - 1.0 / (room - p->viscosity_pole_K)));
    at->viscous_log = log(p->viscous_m_s);
    at->loss = p->yield_loss_per_K * warmer;
    at->friction = friction > 0.0 ? friction : 0.0;
    at->per_stribeck = 1.0 / p->stribeck_m_s;
    at->per_leak = 1.0 / p->leak_N_s_m;
}
