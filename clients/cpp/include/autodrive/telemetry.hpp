/// \file
/// Messages of the devkit protocol: reads the state of a vehicle from a flat dictionary of texts, and writes commands.
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

/// Driving scripts with the devkit protocol.
namespace autodrive::devkit {

/// JSON of the library nlohmann::json.
using Json = nlohmann::json;

/// State of one vehicle. Values that were not received yet are NaN, zero or empty. Signs are those of the devkit
/// profile of the simulator; see `Command`.
struct State {
    double throttle = std::numeric_limits<double>::quiet_NaN();  ///< [-1, 1]
    double steering = std::numeric_limits<double>::quiet_NaN();  ///< steering angle [rad]
    double speed = std::numeric_limits<double>::quiet_NaN();     ///< [m/s], since 2025
    Eigen::Vector2d encoder_ticks = Eigen::Vector2d::Zero();     ///< left and right rear wheel
    Eigen::Vector2d encoder_angles = Eigen::Vector2d::Zero();    ///< left and right rear wheel [rad]
    Eigen::Vector3d position = Eigen::Vector3d::Zero();          ///< rear axle centre in the map [m]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< rotation from vehicle axes to map axes
    Eigen::Vector3d euler_angles = Eigen::Vector3d::Zero();           ///< roll, pitch, yaw in [0, 2 pi) [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();       ///< in vehicle axes [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();    ///< in vehicle axes [m/s^2]
    double lidar_scan_rate = std::numeric_limits<double>::quiet_NaN();  ///< [Hz]
    std::vector<double> lidar_ranges;  ///< one ray each degree, the first straight ahead, the next ones to the left [m]; inf: no echo; empty before the first scan
    std::vector<double> lidar_intensities;        ///< one for each range
    std::vector<std::uint8_t> front_camera_jpeg;  ///< JPEG data, not decoded
    std::vector<std::uint8_t> rear_camera_jpeg;   ///< JPEG data, not decoded
};

/// Command to a vehicle; values that are not set keep their last value.
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
    Telemetry(Telemetry&&) = default;             ///< Moves the texts; copying would invalidate the references to them.
    Telemetry& operator=(Telemetry&&) = default;  ///< Moves the texts.

    /// Parses `["Bridge", {...}]`; none for other messages.
    static std::optional<Telemetry> parse(std::string_view text);

    /// The text of a key; none if the key is missing.
    std::optional<std::string_view> find(std::string_view key) const {
        const auto found = fields_.find(key);
        if (found == fields_.end()) return {};
        return found->second;
    }

    /// Whether there are no keys.
    bool empty() const { return fields_.empty(); }

    /// All keys; every value is a text.
    Json json() const;

private:
    Telemetry() = default;
    bool take_plain(std::string_view text);
    bool take_json(std::string_view text);

    std::map<std::string_view, std::string_view> fields_;
    std::deque<std::string> kept_;  // elements of a deque are not moved
};

/// Reads the values of the vehicle whose keys begin with `prefix` ("V1 "; "" in 2020). Missing and malformed values keep
/// their last value. Returns one message for each malformed value.
std::vector<std::string> read(const Telemetry& telemetry, const std::string& prefix, State& state);

/// Adds a command to a message, in the format that all simulators read.
void write(const Command& command, const std::string& prefix, Json& message);

}  // namespace autodrive::devkit

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/telemetry.ipp"
#endif
