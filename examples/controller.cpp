// Use an exported controller in C++. The exported files are compiled as C and linked; the header is extern "C".
//
//   mrdamper export card.json --c out
//   cc -std=c99 -O2 -c out/damper.c out/damper_tables.c
//   c++ -std=c++17 -Iout controller.cpp damper.o damper_tables.o
#include <cmath>
#include <cstdio>
#include <limits>

#include "damper.h"

namespace {

class Controller {
public:
    Controller() { damper_controller_start(&state_); }

    // Set the gain of the yield force, for example for an aged damper. The controller data are a copy in RAM.
    void set_yield_gain(mrd_real gain) { data_.gains.yield_force = gain; }

    mrd_real step(mrd_real wanted, mrd_real displacement, mrd_real kelvin)
    {
        const mrd_real nothing = std::numeric_limits<mrd_real>::quiet_NaN();
        const damper_controller_input in = {wanted, nothing, displacement, kelvin, nothing};
        damper_controller_output out;
        damper_controller_step_with(&data_, &state_, &in, &out);
        return out.current;
    }

private:
    mrd_track data_ = damper_controller_data;
    damper_controller_state state_{};
};

}  // namespace

int main()
{
    Controller controller;
    controller.set_yield_gain(mrd_real(0.9));
    mrd_real largest = 0;
    for (int i = 0; i < 2000; i++) {
        const double t = 1e-3 * i, wanted = 600.0 * std::cos(6.2832 * t), x = 8e-3 * std::sin(6.2832 * t);
        largest = std::fmax(largest, controller.step(mrd_real(wanted), mrd_real(x), mrd_real(320)));
    }
    std::printf("largest command %.3f\n", double(largest));
    return 0;
}
