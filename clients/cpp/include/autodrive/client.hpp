/// \file
/// A client of the simulator's native protocol: reads Frames, drives, and moves time step by step.
#pragma once

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <map>
#include <string>
#include <utility>

#include "autodrive/messages.hpp"

namespace autodrive {

/// The simulator refused; `what` is its words.
struct Refused : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/// What a client is sent.
struct Subscription {
    std::optional<double> frame_rate;  ///< Frames a second of wall time at most [Hz]; none: each tick; 0: no Frames
    bool scans = true;
    double picture_rate = 0.0;  ///< pictures of each camera a second of wall time at most [Hz]; 0: none
};

/// One connection; for one thread. Every call throws `Refused` with the simulator's words where it will not, and
/// `boost::system::system_error` where the connection fails or nothing comes for `timeout`.
///
///     autodrive::Client simulator("127.0.0.1", 8730);
///     simulator.pause();
///     for (int i = 0; i < 100; ++i) {
///         const autodrive::Frame frame = simulator.step(1, {{"V1", {0.5, 0.1}}});
///     }
class Client {
public:
    explicit Client(const std::string& host = "127.0.0.1", unsigned short port = 8730, const std::string& token = "",
                    const Subscription& subscription = {}, std::chrono::milliseconds timeout = std::chrono::seconds(10))
        : timeout_(timeout), socket_(context_) {
        boost::asio::ip::tcp::resolver resolver(context_);
        const std::string address = host + ":" + std::to_string(port);
        run([&](auto done) {
            boost::beast::get_lowest_layer(socket_).async_connect(resolver.resolve(host, std::to_string(port)),
                                                           [done](Error fault, const auto&) { done(fault); });
        });
        boost::beast::get_lowest_layer(socket_).socket().set_option(boost::asio::ip::tcp::no_delay(true));
        socket_.set_option(boost::beast::websocket::stream_base::decorator([](boost::beast::websocket::request_type& request) {
            request.set(boost::beast::http::field::sec_websocket_protocol, "autodrive.v1");
        }));
        socket_.read_message_max(std::size_t{1} << 26);
        socket_.binary(true);
        run([&](auto done) {
            socket_.async_handshake(address, token.empty() ? "/ws" : "/ws?token=" + token, [done](Error fault) { done(fault); });
        });
        send({{"type", "Hello"}, {"protocol", 1}, {"name", "C++"}});
        Json wish = {{"type", "Subscribe"}, {"scans", subscription.scans}, {"picture_rate", subscription.picture_rate}};
        wish["frame_rate"] = subscription.frame_rate ? Json(*subscription.frame_rate) : Json();
        send(wish);
        while (welcome_.is_null() || scene_.is_null()) take(receive());
    }

    /// The next Frame of the stream. While it was not asked for, the simulator kept the latest, not a backlog.
    Frame next() {
        while (!fresh_) take(receive());
        fresh_ = false;
        return frame_;
    }

    /// Drives a vehicle in autonomous mode. A command is good for half a second of simulated time: send it again.
    void drive(const std::string& vehicle, const Command& command) {
        send({{"type", "Drive"}, {"vehicle", vehicle}, {"command", wire::command(command)}});
    }

    /// While paused: so many ticks of simulated time, the first with these commands; the Frame after them.
    Frame step(int ticks = 1, const std::map<std::string, Command>& commands = {}) {
        Json told = Json::object();
        for (const auto& [vehicle, command] : commands) told[vehicle] = wire::command(command);
        return request({{"type", "Step"}, {"ticks", ticks}, {"commands", told}});
    }

    Frame pause() { return request({{"type", "Pause"}}); }    ///< Stops simulated time.
    Frame resume() { return request({{"type", "Resume"}}); }  ///< Lets it run.
    Frame reset() { return request({{"type", "Reset"}}); }    ///< Brings the initial state back.

    /// Puts a vehicle, at rest, at x, y [m] with a heading [rad].
    Frame teleport(const std::string& vehicle, double x, double y, double yaw = 0.0) {
        return request({{"type", "Teleport"}, {"vehicle", vehicle}, {"x", x}, {"y", y}, {"yaw", yaw}});
    }

    /// Any request of the protocol; the Frame after it.
    Frame request(const Json& request) {
        const std::int64_t id = next_id_++;
        send({{"type", "Please"}, {"id", id}, {"request", request}});
        while (true) {
            const Json message = receive();
            if (message.value("id", Json()) == id) {
                if (message.at("type") == "Fault") throw Refused(message.at("text").get<std::string>());
                show(message.at("frame"));
                fresh_ = false;
                return frame_;
            }
            take(message);
        }
    }

    /// The latest picture of a camera ("front", "rear"); none before the first, or where none are subscribed to.
    const Picture* picture(const std::string& vehicle, const std::string& camera) const {
        const auto found = pictures_.find({vehicle, camera});
        return found == pictures_.end() ? nullptr : &found->second;
    }

    const Json& welcome() const { return welcome_; }  ///< The simulator's greeting.
    const Json& scene() const { return scene_; }      ///< What there is to draw.
    const Json& status() const { return status_; }    ///< Pause, speed, drivers, bridge; null before the first.

private:
    using Error = boost::beast::error_code;
    using Stream = boost::beast::tcp_stream;

    /// Begins something asynchronous and waits for its end, at most `timeout_`.
    template <typename Begin>
    void run(Begin begin) {
        Error result = boost::asio::error::would_block;
        boost::beast::get_lowest_layer(socket_).expires_after(timeout_);
        begin([&result](Error fault) { result = fault; });
        context_.restart();
        context_.run();
        boost::beast::get_lowest_layer(socket_).expires_never();
        if (result) throw boost::system::system_error(result);
    }

    void send(const Json& message) {
        const auto bytes = Json::to_msgpack(message);
        run([&](auto done) {
            socket_.async_write(boost::asio::buffer(bytes), [done](Error fault, std::size_t) { done(fault); });
        });
    }

    Json receive() {
        buffer_.consume(buffer_.size());
        run([&](auto done) { socket_.async_read(buffer_, [done](Error fault, std::size_t) { done(fault); }); });
        const auto* bytes = static_cast<const std::uint8_t*>(buffer_.cdata().data());
        return Json::from_msgpack(bytes, bytes + buffer_.size());
    }

    void take(const Json& message) {
        const std::string type = message.at("type");
        if (type == "Frame") {
            show(message);
        } else if (type == "Scan") {
            scans_[message.at("vehicle")] = wire::scan(message.at("scan"));
        } else if (type == "Picture") {
            pictures_[{message.at("vehicle"), message.at("camera")}] = {message.at("time"), message.at("jpeg").get_binary()};
        } else if (type == "Status") {
            status_ = message;
        } else if (type == "Scene") {
            scene_ = message;
            scans_.clear();
            pictures_.clear();
        } else if (type == "Welcome") {
            welcome_ = message;
        } else if (type == "Fault") {
            throw Refused(message.at("text").get<std::string>());
        }
    }

    void show(const Json& told) {
        frame_ = wire::frame(told);
        fresh_ = true;
        for (auto& [name, vehicle] : frame_.vehicles)
            if (const auto scan = scans_.find(name); scan != scans_.end()) vehicle.lidar = scan->second;
    }

    std::chrono::milliseconds timeout_;
    boost::asio::io_context context_{1};
    boost::beast::websocket::stream<Stream> socket_;
    boost::beast::flat_buffer buffer_;
    std::int64_t next_id_ = 1;
    Json welcome_, scene_, status_;
    Frame frame_;
    bool fresh_ = false;
    std::map<std::string, LidarScan> scans_;
    std::map<std::pair<std::string, std::string>, Picture> pictures_;
};

}  // namespace autodrive
