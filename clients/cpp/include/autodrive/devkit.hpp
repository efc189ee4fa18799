/// \file
/// A driving script for the AutoDRIVE devkits' protocol: the script is the server, the simulator (this one or the
/// original one) connects to it. Typed state in, typed command out, one callback.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <csignal>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "autodrive/text.hpp"

namespace autodrive::devkit {

using Json = nlohmann::json;

/// What the simulator tells of one vehicle. What was not told yet is NaN or empty. Signs are those of the simulator's
/// era; see `Command`.
struct State {
    double throttle = std::numeric_limits<double>::quiet_NaN();  ///< [-1, 1]
    double steering = std::numeric_limits<double>::quiet_NaN();  ///< [rad]
    double speed = std::numeric_limits<double>::quiet_NaN();     ///< [m/s], since 2025
    Eigen::Vector2d encoder_ticks = Eigen::Vector2d::Zero();     ///< left and right rear wheel
    Eigen::Vector2d encoder_angles = Eigen::Vector2d::Zero();    ///< [rad]
    Eigen::Vector3d position = Eigen::Vector3d::Zero();          ///< of the rear axle's middle, in the map [m]
    Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();
    Eigen::Vector3d euler_angles = Eigen::Vector3d::Zero();         ///< roll, pitch, yaw in [0, 2 pi) [rad]
    Eigen::Vector3d angular_velocity = Eigen::Vector3d::Zero();     ///< in the vehicle's axes [rad/s]
    Eigen::Vector3d linear_acceleration = Eigen::Vector3d::Zero();  ///< in the vehicle's axes [m/s^2]
    double lidar_scan_rate = 0.0;                                   ///< [Hz]
    std::vector<double> lidar_ranges;       ///< [m], straight ahead first, then to the left; infinity: nothing there
    std::vector<double> lidar_intensities;  ///< one for each range
    std::vector<std::uint8_t> front_camera_jpeg;  ///< as it came, for the decoder of your choice
    std::vector<std::uint8_t> rear_camera_jpeg;   ///< likewise
};

/// What a vehicle is to do; what is not set is not said, and the last value stands.
struct Command {
    std::optional<double> throttle;  ///< [-1, 1], forward positive; 0 brakes
    /// [-1, 1]. Positive turns right, as the devkits of 2020 to 2023 have it; with `reset` set, to true or false, it
    /// turns left, as since 2025.
    std::optional<double> steering;
    std::optional<int> headlights;  ///< 0 off, 1 low, 2 high beam
    std::optional<int> indicators;  ///< 0 off, 1 left, 2 right, 3 hazard
    std::optional<bool> reset;      ///< soft reset while true
};

/// Takes what a message tells of the vehicle whose keys begin with `prefix` ("V1 "; "" in 2020); other values stay.
inline void read(const Json& data, const std::string& prefix, State& state) {
    const auto text = [&](const char* key) -> std::optional<std::string> {
        const auto found = data.find(prefix + key);
        if (found == data.end()) return {};
        return found->is_string() ? found->get<std::string>() : found->dump();
    };
    const auto scalar = [&](const char* key, double& value) {
        if (const auto told = text(key))
            if (const auto parsed = text::numbers(*told); parsed.size() == 1) value = parsed[0];
    };
    const auto vector = [&](const char* key, auto& value) {
        if (const auto told = text(key))
            if (const auto parsed = text::numbers(*told); static_cast<Eigen::Index>(parsed.size()) == value.size())
                for (Eigen::Index i = 0; i < value.size(); ++i) value[i] = parsed[static_cast<std::size_t>(i)];
    };
    scalar("Throttle", state.throttle);
    scalar("Steering", state.steering);
    scalar("Speed", state.speed);
    vector("Encoder Ticks", state.encoder_ticks);
    vector("Encoder Angles", state.encoder_angles);
    vector("Position", state.position);
    vector("Orientation Quaternion", state.orientation.coeffs());  // x y z w, in the wire's order and in Eigen's
    vector("Orientation Euler Angles", state.euler_angles);
    vector("Angular Velocity", state.angular_velocity);
    vector("Linear Acceleration", state.linear_acceleration);
    scalar("LIDAR Scan Rate", state.lidar_scan_rate);
    if (const auto told = text("LIDAR Range Array")) state.lidar_ranges = text::scan(*told);
    if (const auto told = text("LIDAR Intensity Array")) state.lidar_intensities = text::scan(*told);
    if (const auto told = text("Front Camera Image")) state.front_camera_jpeg = text::base64(*told);
    if (const auto told = text("Rear Camera Image")) state.rear_camera_jpeg = text::base64(*told);
}

/// Adds a command to a message, as the texts that all simulators read.
inline void write(const Command& command, const std::string& prefix, Json& message) {
    if (command.throttle) message[prefix + "Throttle"] = std::to_string(*command.throttle);
    if (command.steering) message[prefix + "Steering"] = std::to_string(*command.steering);
    if (command.headlights) message[prefix + "Headlights"] = std::to_string(*command.headlights);
    if (command.indicators) message[prefix + "Indicators"] = std::to_string(*command.indicators);
    if (command.reset) message[prefix + "Reset"] = *command.reset ? "True" : "False";
}

class Server;

namespace detail {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Tcp = asio::ip::tcp;
using Error = beast::error_code;

/// Engine.IO over WebSocket with one simulator, from its HTTP request to its end.
class Session : public std::enable_shared_from_this<Session> {
public:
    /// Answers a message; an empty text says nothing.
    using Answer = std::function<std::string(const Json& event)>;

    Session(Tcp::socket socket, Answer answer)
        : socket_(std::move(socket)), timer_(socket_.get_executor()), answer_(std::move(answer)) {}

    void start() {
        Error ignored;
        beast::get_lowest_layer(socket_).socket().set_option(Tcp::no_delay(true), ignored);
        beast::get_lowest_layer(socket_).expires_after(patience);
        request_parser_.emplace();
        http::async_read(socket_.next_layer(), buffer_, *request_parser_,
                         [self = shared_from_this()](Error fault, std::size_t) {
                             if (!fault) self->welcome(self->request_parser_->release());
                         });
    }

    void stop() {
        Error ignored;
        timer_.cancel();
        beast::get_lowest_layer(socket_).socket().close(ignored);
    }

private:
    static constexpr std::chrono::seconds patience{10};
    static constexpr std::chrono::seconds ping_interval{25};
    static constexpr std::size_t message_limit = std::size_t{1} << 24;

    void welcome(http::request<http::string_body> request) {
        const std::string target(request.target());
        if (target.rfind("/socket.io/", 0) != 0 || !beast::websocket::is_upgrade(request)) {
            refuse(request);
            return;
        }
        // Engine.IO 3 says so, and its server opens the namespace; the original simulator claims 4 and speaks 3
        is_engine_io_3_ = target.find("EIO=3") != std::string::npos;
        beast::get_lowest_layer(socket_).expires_never();
        socket_.read_message_max(message_limit);
        socket_.text(true);
        socket_.async_accept(request, [self = shared_from_this()](Error fault) {
            if (fault) return;
            self->send(R"(0{"sid":"autodrive","upgrades":[],"pingInterval":25000,"pingTimeout":20000,"maxPayload":16777216})");
            if (self->is_engine_io_3_) self->send("40");
            self->ping_later();
            self->listen();
        });
    }

    void refuse(const http::request<http::string_body>& request) {
        auto response = std::make_shared<http::response<http::string_body>>(http::status::bad_request, request.version());
        response->set(http::field::content_type, "text/plain");
        response->body() = "This is a driving script; a simulator connects by WebSocket to /socket.io/.\n";
        response->prepare_payload();
        http::async_write(socket_.next_layer(), *response,
                          [self = shared_from_this(), response](Error, std::size_t) { self->stop(); });
    }

    void listen() {
        socket_.async_read(buffer_, [self = shared_from_this()](Error fault, std::size_t) {
            if (fault) {
                self->timer_.cancel();
                return;
            }
            self->take(beast::buffers_to_string(self->buffer_.data()));
            self->buffer_.consume(self->buffer_.size());
            self->listen();
        });
    }

    void take(const std::string& packet) {
        if (packet.rfind("42", 0) == 0) {
            const std::size_t body = packet.find('[');
            const Json event = Json::parse(body == std::string::npos ? "" : packet.substr(body), nullptr, false);
            if (event.is_array() && event.size() == 2 && event[0].is_string() && event[1].is_object()) {
                if (std::string said = answer_(event); !said.empty()) send(std::move(said));
            }
            if (body != std::string::npos && body > 2) send("43" + packet.substr(2, body - 2) + "[]");
        } else if (packet.rfind("40", 0) == 0 && !is_engine_io_3_) {
            send(R"(40{"sid":"autodrive"})");
        } else if (!packet.empty() && packet[0] == '2') {
            send("3" + packet.substr(1));
        }
    }

    void ping_later() {
        timer_.expires_after(ping_interval);
        timer_.async_wait([self = shared_from_this()](Error fault) {
            if (fault) return;
            self->send("2");
            self->ping_later();
        });
    }

    void send(std::string packet) {
        waiting_.push_back(std::move(packet));
        if (waiting_.size() == 1) write_next();
    }

    void write_next() {
        socket_.async_write(asio::buffer(waiting_.front()), [self = shared_from_this()](Error fault, std::size_t) {
            if (fault) {
                self->timer_.cancel();
                return;
            }
            self->waiting_.pop_front();
            if (!self->waiting_.empty()) self->write_next();
        });
    }

    beast::websocket::stream<beast::tcp_stream> socket_;
    asio::steady_timer timer_;
    Answer answer_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> request_parser_;
    std::deque<std::string> waiting_;
    bool is_engine_io_3_ = false;
};

}  // namespace detail

/// The server that a driving script is.
///
///     autodrive::devkit::Server server;
///     server.on_state([](const autodrive::devkit::State& state) {
///         autodrive::devkit::Command command;
///         command.throttle = 0.5;
///         command.steering = state.lidar_ranges.empty() ? 0.0 : 0.1;
///         return command;
///     });
///     server.run(4567);
///
/// One thread, asynchronous: it sleeps while nothing comes. What a callback throws ends `run`, which throws it on.
class Server {
public:
    /// State of a vehicle in, its command out.
    using Drive = std::function<Command(const State&)>;
    /// A whole message in, a whole message out; an empty object says nothing.
    using Respond = std::function<Json(const Json& telemetry)>;

    /// Drives a vehicle, by its name "V1", "V2", ...; "" is the only one of the simulator of 2020.
    void on_state(Drive drive, const std::string& vehicle = "V1") {
        drivers_[vehicle] = Driver{vehicle.empty() ? "" : vehicle + " ", std::move(drive), State{}};
    }

    /// Answers the plain messages, for traffic lights and all that has no type here; called after the drivers.
    void on_message(Respond respond) { respond_ = std::move(respond); }

    /// Serves until `stop`, SIGINT or SIGTERM. Throws `boost::system::system_error` where it cannot listen, and what a
    /// callback throws. `port` 0 takes a free one; `listening` is told it.
    void run(unsigned short port = 4567, const std::string& host = "127.0.0.1",
             const std::function<void(unsigned short)>& listening = {}) {
        detail::asio::io_context context(1);
        detail::Tcp::acceptor acceptor(context, {detail::asio::ip::make_address(host), port});
        detail::asio::signal_set signals(context, SIGINT, SIGTERM);
        signals.async_wait([this](detail::Error fault, int) {
            if (!fault) stop();
        });
        accept(acceptor);
        {
            const std::lock_guard lock(mutex_);
            context_ = &context;
        }
        if (listening) listening(acceptor.local_endpoint().port());
        context.run();
        {
            const std::lock_guard lock(mutex_);
            context_ = nullptr;
        }
        if (const auto fault = std::exchange(fault_, nullptr)) std::rethrow_exception(fault);
    }

    /// Ends `run`; from any thread or callback.
    void stop() {
        const std::lock_guard lock(mutex_);
        if (context_) context_->stop();
    }

private:
    struct Driver {
        std::string prefix;
        Drive drive;
        State state;
    };

    void accept(detail::Tcp::acceptor& acceptor) {
        acceptor.async_accept([this, &acceptor](detail::Error fault, detail::Tcp::socket socket) {
            if (!fault)
                std::make_shared<detail::Session>(std::move(socket), [this](const Json& event) { return answer(event); })
                    ->start();
            if (acceptor.is_open()) accept(acceptor);
        });
    }

    std::string answer(const Json& event) {
        if (event[0] != "Bridge" || event[1].empty()) return "";
        try {
            Json message = Json::object();
            for (auto& [name, driver] : drivers_) {
                read(event[1], driver.prefix, driver.state);
                write(driver.drive(driver.state), driver.prefix, message);
            }
            if (respond_)
                for (const auto& [key, value] : respond_(event[1]).items()) message[key] = value;
            return message.empty() ? "" : "42" + Json::array({"Bridge", message}).dump();
        } catch (...) {
            fault_ = std::current_exception();
            stop();
            return "";
        }
    }

    std::map<std::string, Driver> drivers_;
    Respond respond_;
    std::exception_ptr fault_;
    std::mutex mutex_;
    detail::asio::io_context* context_ = nullptr;
};

}  // namespace autodrive::devkit
