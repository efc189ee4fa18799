/// \file
/// The Frame and its readings in the native protocol. SI units and radians; x forward, y left, z up; left turns are
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

/// Native protocol of the simulator.
namespace autodrive {

/// JSON of the library nlohmann::json.
using Json = nlohmann::json;

/// Position [m] and orientation in the map frame.
struct Pose {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();               ///< in the map [m]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< rotation from body axes to map axes
};

/// Rear wheels, left and right; the values do not wrap.
struct EncoderReading {
    double time = 0.0;                                 ///< sample time [s]
    std::int64_t left_ticks = 0;                       ///< left rear wheel
    std::int64_t right_ticks = 0;                      ///< right rear wheel
    Eigen::Vector2d angles = Eigen::Vector2d::Zero();  ///< left and right [rad]
};

/// Inertial data in sensor axes; the acceleration excludes gravity unless the vehicle file says otherwise.
struct ImuReading {
    double time = 0.0;                                                ///< sample time [s]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< rotation from sensor axes to map axes
    Eigen::Vector3d euler = Eigen::Vector3d::Zero();                  ///< roll, pitch, yaw in (-pi, pi] [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();    ///< [m/s^2]
};

/// Ray i has the angle angle_min + i angle_increment [rad], left positive. -inf: too near, inf: no echo (REP 117).
struct LidarScan {
    double time = 0.0;                ///< time of the last ray [s]
    std::vector<double> ranges;       ///< [m]
    std::vector<double> intensities;  ///< one for each range
    double angle_min = 0.0;           ///< angle of the first ray [rad]
    double angle_increment = 0.0;     ///< angle between rays [rad]
    double range_min = 0.0;           ///< minimum range [m]
    double range_max = 0.0;           ///< maximum range [m]
    double scan_rate = 0.0;           ///< [Hz]
    double scan_time = 0.0;           ///< time between scans [s]
    double time_increment = 0.0;      ///< time between rays [s]
};

/// The latest radio message of another vehicle.
struct HeardVehicle {
    double sent = 0.0;                                   ///< time of sending [s]
    double received = 0.0;                               ///< time of arrival [s]
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< in the map, with the noise of the channel [m]
    double yaw = 0.0;                                    ///< [rad]
    double speed = 0.0;                                  ///< negative in reverse [m/s]
    double steering = 0.0;                               ///< left positive [rad]
    int headlights = 0;                                  ///< 0 off, 1 low, 2 high beam
    int indicators = 0;                                  ///< 0 off, 1 left, 2 right, 3 hazard
};

/// The latest radio message of a traffic light.
struct HeardLight {
    double sent = 0.0;                     ///< time of sending [s]
    double received = 0.0;                 ///< time of arrival [s]
    int state = 0;                         ///< 0 off, 1 red, 2 yellow, 3 green
    std::optional<double> time_to_change;  ///< from the time of sending [s]; none: not known, or it does not change
};

/// State of a vehicle at the time of its Frame.
struct VehicleFrame {
    Pose pose;                                                    ///< ground truth of the rear axle centre
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();           ///< in vehicle axes [m/s]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();   ///< in vehicle axes [rad/s]
    double throttle = 0.0;                                        ///< feedback [-1, 1]
    double steering = 0.0;                                        ///< feedback [rad]
    EncoderReading encoders;                                      ///< wheel encoders
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< reading of the indoor positioning system [m]
    ImuReading imu;                  ///< inertial data
    std::optional<LidarScan> lidar;  ///< latest scan; none before the first one
    int headlights = 0;              ///< 0 off, 1 low, 2 high beam
    int indicators = 0;              ///< 0 off, 1 left, 2 right, 3 hazard
    bool is_autonomous = false;      ///< whether a script may drive
    bool is_traffic = false;         ///< whether it is one of the cars of the traffic, which drive themselves
    std::int64_t collision_count = 0;  ///< since the last reset
    std::map<std::string, HeardVehicle> heard_vehicles;  ///< by radio; empty without a channel in the scenario
    std::map<std::string, HeardLight> heard_lights;      ///< by radio; likewise
};

/// What a traffic light shows.
struct TrafficLight {
    int state = 0;                         ///< 0 off, 1 red, 2 yellow, 3 green
    std::optional<double> time_to_change;  ///< [s]; none: it is not known, or the light does not change
    std::string mode;                      ///< "off", "program", "flashing", or "set" by a request
};

/// A collision, a road departure, a red light or stop sign not obeyed, or an event of a race.
struct Event {
    std::string type;  ///< "Collision", "OffRoad", "RedLight", "StopSign", "LapCompleted" ...
    double time = 0.0;    ///< [s]
    std::string vehicle;  ///< name of the vehicle
    std::string other;    ///< name of the other object in a collision, of the traffic light, or of the stop sign
    Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< position [m]
};

/// Weather: amounts from 0 to 1, and the state of the ground.
struct Weather {
    double clouds = 0.0;               ///< [0, 1]
    double fog = 0.0;                  ///< [0, 1]
    double rain = 0.0;                 ///< [0, 1]
    double snow = 0.0;                 ///< [0, 1]
    double wind = 0.0;                 ///< [0, 1]
    std::optional<double> wetness;     ///< of the ground; none: it follows the rain
    std::optional<double> snow_cover;  ///< of the ground; none: it follows the snow
};

/// State of the world after a tick.
struct Frame {
    double time = 0.0;                             ///< time since the last reset [s]
    std::int64_t tick = 0;                         ///< since the last reset
    std::map<std::string, VehicleFrame> vehicles;  ///< by name: "V1", ...
    std::map<std::string, Pose> objects;           ///< movable objects
    std::vector<Event> events;                     ///< since the previous Frame
    bool scene_light = true;                       ///< true: day, false: night
    std::optional<double> time_of_day;             ///< [s since midnight]; none: the light is fixed
    std::optional<Weather> weather;                ///< none: clear sky over dry ground
    std::map<std::string, TrafficLight> traffic_lights;  ///< those of the map, by name
};

/// An image of a sensor camera, not decoded.
struct Picture {
    double time = 0.0;               ///< time of exposure [s]
    std::vector<std::uint8_t> jpeg;  ///< JPEG data
};

/// Command to a vehicle.
struct Command {
    double throttle = 0.0;          ///< [-1, 1], forward positive; 0 brakes
    double steering = 0.0;          ///< [-1, 1] of the steering limit, left positive
    std::optional<int> headlights;  ///< 0 off, 1 low, 2 high beam; none: unchanged
    std::optional<int> indicators;  ///< 0 off, 1 left, 2 right, 3 hazard; none: unchanged
};

}  // namespace autodrive
