// Drives both cars for some ticks in lock-step, and prints all events and what the last Frame says of V1, one value a line.
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iomanip>
#include <iostream>

namespace {

template <typename Values>
void print(const std::string& name, const Values& values) {
    std::cout << name;
    for (const auto& value : values) std::cout << ' ' << value;
    std::cout << '\n';
}

void print(const autodrive::Event& event) {
    std::cout << event.type << ' ' << event.time << ' ' << event.vehicle << ' ' << event.position.transpose();
    if (const auto* collision = event.as<autodrive::Collision>())
        std::cout << ' ' << collision->other << ' ' << collision->impulse;
    if (const auto* ended = event.as<autodrive::CollisionEnded>())
        std::cout << ' ' << ended->other << ' ' << ended->impulse << ' ' << ended->duration;
    if (const auto* passed = event.as<autodrive::CheckpointPassed>())
        std::cout << ' ' << passed->lap << ' ' << passed->checkpoint << ' ' << passed->split << ' ' << passed->sector_time;
    if (const auto* penalty = event.as<autodrive::RacePenalty>())
        std::cout << ' ' << penalty->reason << ' ' << penalty->duration;
    if (const auto* back = event.as<autodrive::SetBack>()) std::cout << ' ' << back->checkpoint;
    if (const auto* changed = event.as<autodrive::RaceStatusChanged>())
        std::cout << ' ' << changed->status << ' ' << changed->reason;
    std::cout << '\n';
}

}  // namespace

int main(int, char** argv) {
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(argv[1])));
    simulator.pause();
    simulator.reset();
    std::cout << std::setprecision(17);
    autodrive::Frame frame;
    for (int step = 0; step < std::atoi(argv[2]); ++step) {
        frame = simulator.step(20, {{"V1", {0.3, 0.0, autodrive::Headlights::HIGH, {}}}, {"V2", {0.5, 0.0, {}, {}}}});
        for (const autodrive::Event& event : frame.events) print(event);
    }
    const autodrive::VehicleFrame& car = frame.vehicles.at("V1");
    print("tick", std::vector{frame.tick});
    print("pose", car.pose.position);
    print("orientation", std::vector{car.pose.orientation.w(), car.pose.orientation.x(), car.pose.orientation.y(),
                                     car.pose.orientation.z()});
    print("speed", std::vector{car.speed()});
    print("ticks", car.encoders.ticks);
    print("angles", car.encoders.angles);
    print("ips", std::vector{car.ips.time, car.ips.position.x(), car.ips.position.y(), car.ips.position.z()});
    print("acceleration", car.imu.linear_acceleration);
    print("lights", std::vector{car.lights.headlights, car.lights.indicators, car.lights.tail_lights,
                                int{car.lights.left_indicator}, int{car.lights.right_indicator},
                                int{car.lights.reverse_lights}});
    print("steering_angle", car.wheels.steering_angle);
    print("rotation_angle", car.wheels.rotation_angle);
    print("wheel_velocity", car.wheels.angular_velocity);
    print("compression", car.wheels.compression);
    print("normal_load", car.wheels.normal_load);
    print("slip_ratio", car.wheels.slip_ratio);
    print("slip_angle", car.wheels.slip_angle);
    const autodrive::RangeReading& range = car.range.value();
    print("range", std::vector{range.time, range.range, range.field_of_view, range.range_min, range.range_max});
    print("radiation", std::vector{range.radiation});
    const autodrive::RaceState& race = car.race.value();
    print("race", std::vector{race.lap_time, race.last_lap_time, race.best_lap_time, race.race_time});
    print("more_race", std::vector{race.penalty, race.distance, race.gap, race.is_wrong_way ? 1.0 : 0.0});
    print("counts", std::vector{std::int64_t{race.status}, race.lap_count, race.lap_total, race.collision_count,
                                race.checkpoint, race.rank});
    const autodrive::OwnReading& beam = car.own.at("beam");
    print("own", beam.values);
    print("columns", beam.columns);
    const autodrive::HeardVehicle& heard = car.v2x.value().vehicles.at("V2");
    print("heard", std::vector{heard.sent, heard.received, heard.yaw, heard.speed, heard.steering});
    print("heard_position", heard.position);
    const autodrive::Weather& weather = frame.weather.value();
    print("weather", std::vector{weather.clouds, weather.fog, weather.rain, weather.snow, weather.wind,
                                 weather.wetness.value(), weather.snow_cover.value()});
    const autodrive::WeatherEffects& effects = frame.weather_effects.value();
    print("effects", std::vector{effects.grip, effects.sight, effects.lidar_dark.value(), effects.lidar_bright.value()});
    for (const auto& [name, object] : frame.objects) print(name, object.pose.position);
    const bool are_equal = car.position == car.ips.position && car.headlights == car.lights.headlights &&
                           car.encoders.left_ticks == car.encoders.ticks[0] && car.heard_vehicles.count("V2") == 1 &&
                           car.heard_vehicles.at("V2").position == heard.position;
    if (!are_equal) return 1;
}
