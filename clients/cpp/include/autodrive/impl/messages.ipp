#pragma once

#include <cstring>
#include <stdexcept>

#include "autodrive/messages.hpp"

namespace autodrive::wire {

/// Reads an array: a MessagePack extension of little-endian values, type 1 for float64 and 2 for int64.
template <typename Value, int code>
std::vector<Value> array(const Json& json) {
    const auto& binary = json.get_binary();
    if (!binary.has_subtype() || binary.subtype() != code || binary.size() % sizeof(Value))
        throw std::runtime_error("an array of the message has an unexpected type");
    std::vector<Value> values(binary.size() / sizeof(Value));
    std::memcpy(values.data(), binary.data(), binary.size());
    return values;
}

inline std::vector<double> doubles(const Json& json) { return array<double, 1>(json); }

template <int size>
Eigen::Matrix<double, size, 1> vector(const Json& json) {
    const auto values = doubles(json);
    if (values.size() != size) throw std::runtime_error("a vector of the message has an unexpected length");
    return Eigen::Map<const Eigen::Matrix<double, size, 1>>(values.data());
}

inline Eigen::Quaterniond quaternion(const Json& json) {
    const auto wxyz = vector<4>(json);
    return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

inline Pose pose(const Json& json) { return {vector<3>(json.at("position")), quaternion(json.at("orientation"))}; }

inline LidarScan scan(const Json& json) {
    return {json.at("time"),      doubles(json.at("ranges")), doubles(json.at("intensities")),
            json.at("angle_min"), json.at("angle_increment"), json.at("range_min"),
            json.at("range_max"), json.at("scan_rate"),       json.at("scan_time"),
            json.at("time_increment")};
}

inline HeardVehicle heard_vehicle(const Json& json) {
    const Json& lights = json.at("lights");
    return {json.at("sent"),  json.at("received"), vector<3>(json.at("position")), json.at("yaw"),
            json.at("speed"), json.at("steering"), lights.at("headlights"),        lights.at("indicators")};
}

inline HeardLight heard_light(const Json& json) {
    HeardLight light{json.at("sent"), json.at("received"), json.at("state"), std::nullopt};
    if (const Json& time = json.at("time_to_change"); !time.is_null()) light.time_to_change = time.get<double>();
    return light;
}

inline VehicleFrame vehicle(const Json& json) {
    VehicleFrame vehicle;
    vehicle.pose = pose(json.at("pose"));
    vehicle.velocity = vector<3>(json.at("velocity"));
    vehicle.angular_velocity = vector<3>(json.at("angular_velocity"));
    vehicle.throttle = json.at("throttle");
    vehicle.steering = json.at("steering");
    const Json& encoders = json.at("encoders");
    const auto ticks = array<std::int64_t, 2>(encoders.at("ticks"));
    vehicle.encoders = {encoders.at("time"), ticks.at(0), ticks.at(1), vector<2>(encoders.at("angles"))};
    vehicle.position = vector<3>(json.at("ips").at("position"));
    const Json& imu = json.at("imu");
    vehicle.imu = {imu.at("time"), quaternion(imu.at("orientation")), vector<3>(imu.at("euler")),
                   vector<3>(imu.at("angular_velocity")), vector<3>(imu.at("linear_acceleration"))};
    vehicle.headlights = json.at("lights").at("headlights");
    vehicle.indicators = json.at("lights").at("indicators");
    vehicle.is_autonomous = json.at("is_autonomous");
    vehicle.is_traffic = json.at("is_traffic");
    vehicle.collision_count = json.at("collision_count");
    if (const auto v2x = json.find("v2x"); v2x != json.end() && !v2x->is_null()) {
        for (const auto& [name, value] : v2x->at("vehicles").items()) vehicle.heard_vehicles[name] = heard_vehicle(value);
        for (const auto& [name, value] : v2x->at("lights").items()) vehicle.heard_lights[name] = heard_light(value);
    }
    return vehicle;
}

inline Weather weather(const Json& json) {
    return {json.at("clouds"), json.at("fog"),     json.at("rain"),      json.at("snow"),
            json.at("wind"),   json.at("wetness").get<double>(), json.at("snow_cover").get<double>()};
}

inline Json weather(const Weather& weather) {
    Json json = {{"clouds", weather.clouds}, {"fog", weather.fog}, {"rain", weather.rain}, {"snow", weather.snow},
                 {"wind", weather.wind}};
    if (weather.wetness) json["wetness"] = *weather.wetness;
    if (weather.snow_cover) json["snow_cover"] = *weather.snow_cover;
    return json;
}

inline TrafficLight traffic_light(const Json& json) {
    TrafficLight light{json.at("state"), std::nullopt, json.at("mode")};
    if (const Json& time = json.at("time_to_change"); !time.is_null()) light.time_to_change = time.get<double>();
    return light;
}

inline std::string other(const Json& event) {
    for (const char* key : {"other", "light", "sign"})
        if (const auto name = event.find(key); name != event.end()) return *name;
    return "";
}

inline Frame frame(const Json& json) {
    Frame frame;
    frame.time = json.at("time");
    frame.tick = json.at("tick");
    frame.scene_light = json.at("scene_light");
    if (const auto time = json.find("time_of_day"); time != json.end() && !time->is_null()) frame.time_of_day = time->get<double>();
    if (const auto now = json.find("weather"); now != json.end() && !now->is_null()) frame.weather = weather(*now);
    for (const auto& [name, value] : json.at("vehicles").items()) frame.vehicles[name] = vehicle(value);
    for (const auto& [name, value] : json.at("objects").items()) frame.objects[name] = pose(value.at("pose"));
    for (const Json& event : json.at("events"))
        frame.events.push_back({event.at("type"), event.at("time"), event.at("vehicle"), other(event),
                                vector<3>(event.at("position"))});
    if (const auto lights = json.find("traffic_lights"); lights != json.end())
        for (const auto& [name, value] : lights->items()) frame.traffic_lights[name] = traffic_light(value);
    return frame;
}

inline Json command(const Command& command) {
    Json json = {{"throttle", command.throttle}, {"steering", command.steering}};
    if (command.headlights) json["headlights"] = *command.headlights;
    if (command.indicators) json["indicators"] = *command.indicators;
    return json;
}

}  // namespace autodrive::wire
