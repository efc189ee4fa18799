// Sets a traffic light and prints the cars of the traffic and what V1 hears by radio, after one tick in lock-step.
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iomanip>
#include <iostream>

int main(int, char** argv) {
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(argv[1])));
    simulator.pause();
    simulator.reset();
    const auto set = simulator.set_traffic_light("traffic_light_3", 2).traffic_lights.at("traffic_light_3");
    const autodrive::Frame frame = simulator.step(1, {});
    const autodrive::VehicleFrame& car = frame.vehicles.at("V1");
    std::cout << std::setprecision(17) << set.state << ' ' << set.mode << std::endl;
    for (const auto& [name, one] : frame.vehicles)
        if (one.is_traffic) std::cout << name << ' ';
    std::cout << std::endl;
    for (const auto& [name, one] : car.heard_vehicles)
        std::cout << name << ' ' << one.sent << ' ' << one.received << ' ' << one.position.transpose() << ' ' << one.yaw
                  << ' ' << one.speed << ' ' << one.steering << ' ' << one.headlights << ' ' << one.indicators << std::endl;
    for (const auto& [name, one] : car.heard_lights)
        std::cout << name << ' ' << one.sent << ' ' << one.state << ' ' << one.time_to_change.value_or(-1.0) << std::endl;
    simulator.set_traffic_light("traffic_light_3", {});
    simulator.resume();
}
