#pragma once

#include <algorithm>

#include "autodrive/telemetry.hpp"

namespace autodrive::devkit {

AUTODRIVE_INLINE std::optional<Telemetry> Telemetry::parse(std::string_view text) {
    Telemetry telemetry;
    if (telemetry.take_plain(text)) return telemetry;
    telemetry.fields_.clear();
    if (telemetry.take_json(text)) return telemetry;
    return {};
}

AUTODRIVE_INLINE Json Telemetry::json() const {
    Json all = Json::object();
    for (const auto& [key, value] : fields_) all[std::string(key)] = value;
    return all;
}

/// Parses texts without escapes, as sent by all simulators, without copying. False for other JSON.
AUTODRIVE_INLINE bool Telemetry::take_plain(std::string_view text) {
    const auto skip = [&](char wanted) {
        while (!text.empty() && (text[0] == ' ' || text[0] == '\n' || text[0] == '\r' || text[0] == '\t'))
            text.remove_prefix(1);
        if (text.empty() || text[0] != wanted) return false;
        text.remove_prefix(1);
        return true;
    };
    const auto quoted = [&](std::string_view& inside) {
        if (!skip('"')) return false;
        const std::size_t end = text.find('"');
        if (end == std::string_view::npos) return false;
        inside = text.substr(0, end);
        text.remove_prefix(end + 1);
        return inside.find('\\') == std::string_view::npos;
    };
    std::string_view event, key, value;
    if (!skip('[') || !quoted(event) || event != "Bridge" || !skip(',') || !skip('{')) return false;
    while (quoted(key)) {
        if (!skip(':') || !quoted(value)) return false;
        fields_.insert_or_assign(key, value);
        if (!skip(',')) break;
    }
    return skip('}') && skip(']') && text.empty() && !fields_.empty();
}

/// Parses any JSON. Numbers become texts; null, arrays and objects are skipped.
AUTODRIVE_INLINE bool Telemetry::take_json(std::string_view text) {
    const Json event = Json::parse(text.begin(), text.end(), nullptr, false);
    if (!event.is_array() || event.size() != 2 || event[0] != "Bridge" || !event[1].is_object()) return false;
    for (const auto& [key, value] : event[1].items()) {
        if (value.is_null() || value.is_structured()) continue;
        const std::string& kept_key = kept_.emplace_back(key);
        fields_[kept_key] = kept_.emplace_back(value.is_string() ? value.get<std::string>() : value.dump());
    }
    return true;
}

AUTODRIVE_INLINE std::vector<std::string> read(const Telemetry& telemetry, const std::string& prefix, State& state) {
    std::vector<std::string> errors;
    const auto field = [&](const char* key, auto&& take) {
        const auto text = telemetry.find(prefix + key);
        if (!text) return;
        try {
            take(*text);
        } catch (const std::invalid_argument& error) {
            errors.push_back(prefix + key + ": " + error.what());
        }
    };
    const auto numbers = [&](const char* key, double* to, std::size_t count) {
        field(key, [&](std::string_view text) {
            const std::vector<double> read = text::numbers(text);
            if (read.size() != count)
                throw std::invalid_argument(std::to_string(read.size()) + " numbers instead of " + std::to_string(count));
            std::copy(read.begin(), read.end(), to);
        });
    };
    numbers("Throttle", &state.throttle, 1);
    numbers("Steering", &state.steering, 1);
    numbers("Speed", &state.speed, 1);
    numbers("Encoder Ticks", state.encoder_ticks.data(), 2);
    numbers("Encoder Angles", state.encoder_angles.data(), 2);
    numbers("Position", state.position.data(), 3);
    numbers("Orientation Quaternion", state.orientation.coeffs().data(), 4);  // x y z w, on the wire and in Eigen
    numbers("Orientation Euler Angles", state.euler_angles.data(), 3);
    numbers("Angular Velocity", state.angular_velocity.data(), 3);
    numbers("Linear Acceleration", state.linear_acceleration.data(), 3);
    numbers("LIDAR Scan Rate", &state.lidar_scan_rate, 1);
    field("LIDAR Range Array", [&](std::string_view text) { state.lidar_ranges = text::scan(text); });
    field("LIDAR Intensity Array", [&](std::string_view text) { state.lidar_intensities = text::scan(text); });
    field("Front Camera Image", [&](std::string_view text) { state.front_camera_jpeg = text::base64(text); });
    field("Rear Camera Image", [&](std::string_view text) { state.rear_camera_jpeg = text::base64(text); });
    return errors;
}

AUTODRIVE_INLINE void write(const Command& command, const std::string& prefix, Json& message) {
    if (command.throttle) message[prefix + "Throttle"] = text::fixed(*command.throttle);
    if (command.steering) message[prefix + "Steering"] = text::fixed(*command.steering);
    if (command.headlights) message[prefix + "Headlights"] = std::to_string(*command.headlights);
    if (command.indicators) message[prefix + "Indicators"] = std::to_string(*command.indicators);
    if (command.steering && !command.reset) message[prefix + "Steering Sign"] = "right";  // only this simulator reads it
    if (command.reset) message[prefix + "Reset"] = *command.reset ? "True" : "False";
}

}  // namespace autodrive::devkit
