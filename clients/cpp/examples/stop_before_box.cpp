// Drives straight on and stops before the first obstacle that the LIDAR sees.
// Start it, then the simulator: autodrive run boxes --devkit 127.0.0.1:4567
#include <algorithm>
#include <autodrive/devkit.hpp>
#include <cstdlib>
#include <iostream>

using autodrive::devkit::Command;
using autodrive::devkit::State;

constexpr double half_width = 0.12;        // of what the car needs [m]
constexpr double stop = 0.25, slow = 0.6;  // from the LIDAR to the obstacle [m]

/// How far ahead the way is free [m]: ray i looks to the left by i of 360 degrees, ray 0 straight ahead.
double free_way(const std::vector<double>& ranges) {
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
        const double share = (free_way(state.lidar_ranges) - stop) / (slow - stop);
        Command command;
        command.throttle = share <= 0.0 ? 0.0 : std::clamp(share, 0.2, 0.8);
        command.steering = 0.0;
        command.headlights = share <= 0.0 ? 1 : 0;
        return command;
    });
    const auto port = static_cast<unsigned short>(argc > 1 ? std::atoi(argv[1]) : 4567);
    server.run(port, "127.0.0.1", [](unsigned short bound) { std::cout << "listening on " << bound << std::endl; });
}
