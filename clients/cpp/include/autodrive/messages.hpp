/// \file
/// The Frame and its readings, as the native protocol has them. SI and radians; x forward, y left, z up; left turns
/// positive. See `docs/protocol.md`.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

/// The simulator's own protocol.
namespace autodrive {

/// JSON, by nlohmann.
using Json = nlohmann::json;

/// Position [m] and orientation in the map frame.
struct Pose {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< in the map [m]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< from the body's axes to the map's
};

/// Rear wheels, left then right; never wrap.
struct EncoderReading {
    double time = 0.0;                                 ///< when it was read [s]
    std::int64_t left_ticks = 0;                       ///< of the left rear wheel
    std::int64_t right_ticks = 0;                      ///< of the right rear wheel
    Eigen::Vector2d angles = Eigen::Vector2d::Zero();  ///< left and right [rad]
};

/// Inertial data in the sensor's axes; the acceleration is without gravity unless the vehicle's file says otherwise.
struct ImuReading {
    double time = 0.0;                                                ///< when it was read [s]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< of the sensor in the map
    Eigen::Vector3d euler = Eigen::Vector3d::Zero();                  ///< roll, pitch, yaw in (-pi, pi] [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();    ///< [m/s^2]
};

/// Ray i looks along angle_min + i angle_increment [rad], left positive. -inf: too near, inf: nothing there (REP 117).
struct LidarScan {
    double time = 0.0;                ///< of the last ray [s]
    std::vector<double> ranges;       ///< [m]
    std::vector<double> intensities;  ///< one for each range
    double angle_min = 0.0;           ///< of the first ray [rad]
    double angle_increment = 0.0;     ///< from ray to ray [rad]
    double range_min = 0.0;           ///< what is nearer is too near [m]
    double range_max = 0.0;           ///< what is further is not seen [m]
    double scan_rate = 0.0;           ///< [Hz]
    double scan_time = 0.0;           ///< from scan to scan [s]
    double time_increment = 0.0;      ///< from ray to ray [s]
};

/// A vehicle at the time of its Frame.
struct VehicleFrame {
    Pose pose;                                                    ///< of the rear axle's middle: ground truth
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();           ///< in the vehicle's axes [m/s]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();   ///< in the vehicle's axes [rad/s]
    double throttle = 0.0;                                        ///< feedback [-1, 1]
    double steering = 0.0;                                        ///< feedback [rad]
    EncoderReading encoders;                                      ///< of the rear wheels
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< as the indoor positioning system has it [m]
    ImuReading imu;                  ///< inertial data
    std::optional<LidarScan> lidar;  ///< the latest; none before the first
    int headlights = 0;              ///< 0 off, 1 low, 2 high beam
    int indicators = 0;              ///< 0 off, 1 left, 2 right, 3 hazard
    bool is_autonomous = false;      ///< whether a script drives
    std::int64_t collision_count = 0;  ///< since reset
};

/// A collision, a vehicle that left the road, or that came back.
struct Event {
    std::string type;  ///< "Collision", "OffRoad" or "BackOnRoad"
    double time = 0.0;    ///< [s]
    std::string vehicle;  ///< whose
    std::string other;    ///< of a collision: what was hit
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< where [m]
};

/// The world after a tick.
struct Frame {
    double time = 0.0;                             ///< since reset [s]
    std::int64_t tick = 0;                         ///< since reset
    std::map<std::string, VehicleFrame> vehicles;  ///< by their names, "V1", ...
    std::map<std::string, Pose> objects;           ///< movable things
    std::vector<Event> events;                     ///< all since the Frame before
    bool scene_light = true;                       ///< day, or night
};

/// A picture of a sensor camera, as it came.
struct Picture {
    double time = 0.0;               ///< when it was taken [s]
    std::vector<std::uint8_t> jpeg;  ///< for the decoder of your choice
};

/// What a driver wants of a vehicle.
struct Command {
    double throttle = 0.0;          ///< [-1, 1], forward positive; 0 brakes
    double steering = 0.0;          ///< [-1, 1] of the steering limit, left positive
    std::optional<int> headlights;  ///< 0 off, 1 low, 2 high beam; none: as they are
    std::optional<int> indicators;  ///< 0 off, 1 left, 2 right, 3 hazard; none: as they are
};

}  // namespace autodrive
