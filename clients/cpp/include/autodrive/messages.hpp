/// \file
/// The Frame and its readings, as the native protocol has them. SI and radians; x forward, y left, z up; left turns
/// positive. See `docs/protocol.md`.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace autodrive {

using Json = nlohmann::json;

/// Position [m] and orientation in the map frame.
struct Pose {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
};

/// Rear wheels, left then right; never wrap.
struct EncoderReading {
    double time = 0.0;  ///< [s]
    std::int64_t left_ticks = 0, right_ticks = 0;
    Eigen::Vector2d angles = Eigen::Vector2d::Zero();  ///< [rad]
};

/// Inertial data in the sensor's axes; the acceleration is without gravity unless the vehicle's file says otherwise.
struct ImuReading {
    double time = 0.0;  ///< [s]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
    Eigen::Vector3d euler = Eigen::Vector3d::Zero();                ///< roll, pitch, yaw in (-pi, pi] [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();     ///< [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();  ///< [m/s^2]
};

/// Ray i looks along angle_min + i angle_increment [rad], left positive. -inf: too near, inf: nothing there (REP 117).
struct LidarScan {
    double time = 0.0;           ///< of the last ray [s]
    std::vector<double> ranges;  ///< [m]
    std::vector<double> intensities;
    double angle_min = 0.0, angle_increment = 0.0;  ///< [rad]
    double range_min = 0.0, range_max = 0.0;        ///< [m]
    double scan_rate = 0.0;                         ///< [Hz]
    double scan_time = 0.0, time_increment = 0.0;   ///< [s]
};

/// A vehicle at the time of its Frame.
struct VehicleFrame {
    Pose pose;                                                    ///< of the rear axle's middle: ground truth
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();           ///< in the vehicle's axes [m/s]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();   ///< in the vehicle's axes [rad/s]
    double throttle = 0.0;                                        ///< feedback [-1, 1]
    double steering = 0.0;                                        ///< feedback [rad]
    EncoderReading encoders;
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< as the indoor positioning system has it [m]
    ImuReading imu;
    std::optional<LidarScan> lidar;  ///< the latest; none before the first
    int headlights = 0;              ///< 0 off, 1 low, 2 high beam
    int indicators = 0;              ///< 0 off, 1 left, 2 right, 3 hazard
    bool is_autonomous = false;      ///< whether a script drives
    std::int64_t collision_count = 0;
};

/// A collision, a vehicle that left the road, or that came back.
struct Event {
    std::string type;  ///< "Collision", "OffRoad" or "BackOnRoad"
    double time = 0.0;
    std::string vehicle;
    std::string other;  ///< of a collision: what was hit
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
};

/// The world after a tick.
struct Frame {
    double time = 0.0;  ///< since reset [s]
    std::int64_t tick = 0;
    std::map<std::string, VehicleFrame> vehicles;
    std::map<std::string, Pose> objects;  ///< movable things
    std::vector<Event> events;            ///< all since the Frame before
    bool scene_light = true;
};

/// A picture of a sensor camera, as it came.
struct Picture {
    double time = 0.0;
    std::vector<std::uint8_t> jpeg;
};

/// What a driver wants of a vehicle.
struct Command {
    double throttle = 0.0;  ///< [-1, 1], forward positive; 0 brakes
    double steering = 0.0;  ///< [-1, 1] of the steering limit, left positive
    std::optional<int> headlights, indicators;
};

namespace wire {

/// An array of the wire: a MessagePack extension of little-endian values, 1 for float64 and 2 for int64.
template <typename Value, int code>
std::vector<Value> array(const Json& json) {
    const auto& binary = json.get_binary();
    if (!binary.has_subtype() || binary.subtype() != code || binary.size() % sizeof(Value))
        throw std::runtime_error("an array of the wire has another type than expected");
    std::vector<Value> values(binary.size() / sizeof(Value));
    std::memcpy(values.data(), binary.data(), binary.size());
    return values;
}

inline std::vector<double> doubles(const Json& json) { return array<double, 1>(json); }

template <int size>
Eigen::Matrix<double, size, 1> vector(const Json& json) {
    const auto values = doubles(json);
    if (values.size() != size) throw std::runtime_error("a vector of the wire has another length than expected");
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
    vehicle.collision_count = json.at("collision_count");
    return vehicle;
}

inline Frame frame(const Json& json) {
    Frame frame;
    frame.time = json.at("time");
    frame.tick = json.at("tick");
    frame.scene_light = json.at("scene_light");
    for (const auto& [name, told] : json.at("vehicles").items()) frame.vehicles[name] = vehicle(told);
    for (const auto& [name, told] : json.at("objects").items()) frame.objects[name] = pose(told.at("pose"));
    for (const Json& told : json.at("events"))
        frame.events.push_back({told.at("type"), told.at("time"), told.at("vehicle"), told.value("other", ""),
                                vector<3>(told.at("position"))});
    return frame;
}

inline Json command(const Command& command) {
    Json json = {{"throttle", command.throttle}, {"steering", command.steering}};
    if (command.headlights) json["headlights"] = *command.headlights;
    if (command.indicators) json["indicators"] = *command.indicators;
    return json;
}

}  // namespace wire

}  // namespace autodrive
