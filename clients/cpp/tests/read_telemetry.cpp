// Reads a message of the simulator from the standard input and writes the state of V1, a field a line; then the faults.
#include <autodrive/telemetry.hpp>
#include <iomanip>
#include <iostream>
#include <iterator>

using autodrive::devkit::State;
using autodrive::devkit::Telemetry;

namespace {

template <typename Values>
void tell(const char* name, const Values& values) {
    std::cout << name;
    for (const auto value : values) std::cout << ' ' << +value;
    std::cout << '\n';
}

}  // namespace

int main() {
    const std::string message((std::istreambuf_iterator<char>(std::cin)), std::istreambuf_iterator<char>());
    const auto telemetry = Telemetry::parse(message);
    if (!telemetry) {
        std::cout << "no message" << std::endl;
        return 0;
    }
    State state;
    const auto faults = autodrive::devkit::read(*telemetry, "V1 ", state);
    std::cout << std::setprecision(17);
    tell("throttle", std::vector{state.throttle});
    tell("steering", std::vector{state.steering});
    tell("speed", std::vector{state.speed});
    tell("encoder_ticks", state.encoder_ticks);
    tell("encoder_angles", state.encoder_angles);
    tell("position", state.position);
    tell("orientation", state.orientation.coeffs());
    tell("euler_angles", state.euler_angles);
    tell("angular_velocity", state.angular_velocity);
    tell("linear_acceleration", state.linear_acceleration);
    tell("lidar_scan_rate", std::vector{state.lidar_scan_rate});
    tell("lidar_ranges", state.lidar_ranges);
    tell("lidar_intensities", state.lidar_intensities);
    tell("front_camera_jpeg", state.front_camera_jpeg);
    tell("rear_camera_jpeg", state.rear_camera_jpeg);
    for (const std::string& fault : faults) std::cout << "fault " << fault << '\n';
}
