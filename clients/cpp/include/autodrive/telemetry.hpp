/// \file
/// What the devkits' messages hold: the state of a vehicle and the command to it, both from and to flat texts.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <deque>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "autodrive/text.hpp"

/// Driving scripts for the AutoDRIVE devkits' protocol.
namespace autodrive::devkit {

/// JSON, by nlohmann.
using Json = nlohmann::json;

/// What the simulator tells of one vehicle. What was not told yet is NaN, zero or empty. Signs are those of the
/// simulator's era; see `Command`.
struct State {
    double throttle = std::numeric_limits<double>::quiet_NaN();  ///< [-1, 1]
    double steering = std::numeric_limits<double>::quiet_NaN();  ///< angle of the steering [rad]
    double speed = std::numeric_limits<double>::quiet_NaN();     ///< [m/s], since 2025
    Eigen::Vector2d encoder_ticks = Eigen::Vector2d::Zero();     ///< left and right rear wheel
    Eigen::Vector2d encoder_angles = Eigen::Vector2d::Zero();    ///< left and right rear wheel [rad]
    Eigen::Vector3d position = Eigen::Vector3d::Zero();          ///< of the rear axle's middle, in the map [m]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< of the vehicle in the map
    Eigen::Vector3d euler_angles = Eigen::Vector3d::Zero();           ///< roll, pitch, yaw in [0, 2 pi) [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< in the vehicle's axes [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();    ///< in the vehicle's axes [m/s^2]
    double lidar_scan_rate = std::numeric_limits<double>::quiet_NaN();  ///< [Hz]
    std::vector<double> lidar_ranges;  ///< a degree each, the first straight ahead, then to the left [m]; inf: nothing there
    std::vector<double> lidar_intensities;        ///< one for each range
    std::vector<std::uint8_t> front_camera_jpeg;  ///< the picture as it came, for the decoder of your choice
    std::vector<std::uint8_t> rear_camera_jpeg;   ///< the picture as it came
};

/// What a vehicle is to do; what is not set is not said, and the last value stands.
struct Command {
    std::optional<double> throttle;  ///< [-1, 1], forward positive; 0 brakes
    std::optional<double> steering;  ///< [-1, 1], positive turns right as until 2023; with `reset` set, to true or
                                     ///< false, it turns left, as since 2025
    std::optional<int> headlights;   ///< 0 off, 1 low, 2 high beam
    std::optional<int> indicators;   ///< 0 off, 1 left, 2 right, 3 hazard
    std::optional<bool> reset;       ///< soft reset while true
};

/// A message of the simulator: texts by their keys. It refers to the text that it was read from.
class Telemetry {
public:
    Telemetry(Telemetry&&) = default;             ///< Takes the texts over; what refers to them cannot be copied.
    Telemetry& operator=(Telemetry&&) = default;  ///< Takes the texts over.

    /// Reads `["Bridge", {...}]`; none if it is no such message.
    static std::optional<Telemetry> parse(std::string_view text);

    /// The text of a key; none if nothing is told of it.
    std::optional<std::string_view> find(std::string_view key) const {
        const auto found = fields_.find(key);
        if (found == fields_.end()) return {};
        return found->second;
    }

    /// Whether it tells nothing.
    bool empty() const { return fields_.empty(); }

    /// The whole of it, every value a text.
    Json json() const;

private:
    Telemetry() = default;
    bool take_plain(std::string_view text);
    bool take_json(std::string_view text);

    std::map<std::string_view, std::string_view> fields_;
    std::deque<std::string> kept_;  // a deque's elements stay where they are
};

/// Takes what a message tells of the vehicle whose keys begin with `prefix` ("V1 "; "" in 2020). What is not told, or
/// cannot be read, keeps its last value; the faults are returned, a sentence each.
std::vector<std::string> read(const Telemetry& telemetry, const std::string& prefix, State& state);

/// Adds a command to a message, as the texts that all simulators read.
void write(const Command& command, const std::string& prefix, Json& message);

}  // namespace autodrive::devkit

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/telemetry.ipp"
#endif
