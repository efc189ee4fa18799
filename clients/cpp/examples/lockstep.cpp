// Drives for two seconds in lock-step: the simulation runs only during a step, so all runs are equal.
// Start the simulator first: autodrive run mini_map --mode autonomous
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iomanip>
#include <iostream>

int main(int argc, char** argv) {
    const auto port = static_cast<unsigned short>(argc > 1 ? std::atoi(argv[1]) : 8730);
    autodrive::Client simulator("127.0.0.1", port);
    simulator.pause();
    autodrive::Frame frame = simulator.reset();
    while (frame.time < 2.0) frame = simulator.step(1, {{"V1", {0.5, 0.2, {}, {}}}});
    const autodrive::VehicleFrame& car = frame.vehicles.at("V1");
    std::cout << std::setprecision(17) << frame.tick << ' ' << car.pose.position.transpose() << ' ' << car.velocity.x()
              << ' ' << (car.lidar ? car.lidar->ranges.at(0) : -1.0) << std::endl;
    simulator.resume();
}
