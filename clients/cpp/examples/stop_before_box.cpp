// Drives straight ahead and stops in front of the first obstacle that the LIDAR sees.
// Start this program, then the simulator: autodrive run boxes --devkit 127.0.0.1:4567
#include <algorithm>
#include <autodrive/devkit.hpp>
#include <cstdlib>
#include <iostream>

using autodrive::devkit::Command;
using autodrive::devkit::State;

constexpr double half_width = 0.12;        // half width of the path [m]
constexpr double stop = 0.25, slow = 0.6;  // distances from the LIDAR to the obstacle [m]

/// Free distance ahead [m]. Ray 0 points straight ahead, the next ones to the left; they cover 360 degrees.
double free_distance(const std::vector<double>& ranges) {
    double free = 12.0;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
        const double angle = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(ranges.size());
        const double x = ranges[i] * std::cos(angle), y = ranges[i] * std::sin(angle);
        if (std::isfinite(ranges[i]) && x > 0.0 && std::abs(y) < half_width) free = std::min(free, x);
    }
    return free;
}

int main(int argc, char** argv) {
    autodrive::devkit::Server server;
    server.on_state([](const State& state) {
        const double fraction = (free_distance(state.lidar_ranges) - stop) / (slow - stop);
        Command command;
        command.throttle = fraction <= 0.0 ? 0.0 : std::clamp(fraction, 0.2, 0.8);
        command.steering = 0.0;
        command.headlights = fraction <= 0.0 ? 1 : 0;
        return command;
    });
    const auto port = static_cast<unsigned short>(argc > 1 ? std::atoi(argv[1]) : 4567);
    server.run(port, "127.0.0.1", [](unsigned short bound) { std::cout << "listening on " << bound << std::endl; });
}
