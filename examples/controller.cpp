// An exported controller in C++: the header is extern "C", the files are compiled as C and linked.
//
//   mrdamper export card.json --c out
//   cc -std=c99 -O2 -c out/damper.c out/damper_tables.c out/damper_parameters.c
//   c++ -std=c++17 -Iout controller.cpp damper.o damper_tables.o damper_parameters.o
#include <cmath>
#include <cstdio>
#include <limits>

#include "damper_parameters.h"

namespace {

class Controller {
public:
    Controller()
    {
        damper_controller_start(&state_);
        damper_parameters_default(&block_);
    }

    // Changes a value of the block and takes it over; what is outside its limits is refused.
    bool set(int place, mrd_real value)
    {
        damper_parameters changed = block_;
        changed.value[place] = value;
        damper_parameters_seal(&changed);
        if (damper_parameters_check(&changed) != 0) return false;
        block_ = changed;
        return damper_controller_restore(&data_, &state_, &block_) == 0;
    }

    mrd_real step(mrd_real wanted, mrd_real displacement, mrd_real kelvin)
    {
        const mrd_real nothing = std::numeric_limits<mrd_real>::quiet_NaN();
        const damper_controller_input in = {wanted, nothing, displacement, kelvin, nothing, nothing};
        damper_controller_output out;
        damper_controller_step_with(&data_, &state_, &in, &out);
        return out.current;
    }

private:
    damper_parameters block_{};
    mrd_track data_ = damper_controller_data;
    damper_controller_state state_{};
};

}  // namespace

int main()
{
    Controller controller;
    const bool refused = !controller.set(DAMPER_CONTROLLER_YIELD_GAIN, mrd_real(100));
    const bool taken = controller.set(DAMPER_CONTROLLER_YIELD_GAIN, mrd_real(0.9));
    mrd_real largest = 0;
    for (int i = 0; i < 2000; i++) {
        const double t = 1e-3 * i, wanted = 600.0 * std::cos(6.2832 * t), x = 8e-3 * std::sin(6.2832 * t);
        largest = std::fmax(largest, controller.step(mrd_real(wanted), mrd_real(x), mrd_real(320)));
    }
    std::printf("refused %d, taken %d, largest command %.3f\n", refused, taken, double(largest));
    return 0;
}
