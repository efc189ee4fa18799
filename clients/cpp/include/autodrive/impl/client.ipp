#pragma once

#include <iostream>

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include "autodrive/client.hpp"
#include "autodrive/impl/messages.ipp"
#include "autodrive/impl/msgpack.ipp"
#include "autodrive/impl/target.ipp"

namespace autodrive {

namespace detail {

/// A WebSocket connection; every operation has a timeout.
class Connection {
public:
    Connection(const std::string& host, unsigned short port, const std::string& token, std::chrono::milliseconds timeout)
        : timeout_(timeout), socket_(context_) {
        namespace websocket = boost::beast::websocket;
        boost::asio::ip::tcp::resolver resolver(context_);
        const std::string number = std::to_string(port);
        run([&](auto done) {
            boost::beast::get_lowest_layer(socket_).async_connect(resolver.resolve(host, number),
                                                                  [done](Error error, const auto&) { done(error); });
        });
        boost::beast::get_lowest_layer(socket_).socket().set_option(boost::asio::ip::tcp::no_delay(true));
        socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
            request.set(boost::beast::http::field::sec_websocket_protocol, SUBPROTOCOL);
        }));
        socket_.read_message_max(std::size_t{1} << 26);
        socket_.binary(true);
        run([&](auto done) {
            socket_.async_handshake(address_text(host, port), token.empty() ? "/ws" : "/ws?token=" + escaped(token),
                                    [done](Error error) { done(error); });
        });
    }

    void send(const std::vector<std::uint8_t>& bytes) {
        run([&](auto done) {
            socket_.async_write(boost::asio::buffer(bytes), [done](Error error, std::size_t) { done(error); });
        });
    }

    /// The next message; valid until the next call.
    std::pair<const std::uint8_t*, std::size_t> receive() {
        buffer_.consume(buffer_.size());
        run([&](auto done) { socket_.async_read(buffer_, [done](Error error, std::size_t) { done(error); }); });
        return {static_cast<const std::uint8_t*>(buffer_.cdata().data()), buffer_.size()};
    }

private:
    using Error = boost::beast::error_code;

    /// Starts an asynchronous operation and waits for its end, at most `timeout_`.
    template <typename Start>
    void run(Start start) {
        Error result = boost::asio::error::would_block;
        boost::beast::get_lowest_layer(socket_).expires_after(timeout_);
        start([&result](Error error) { result = error; });
        context_.restart();
        context_.run();
        boost::beast::get_lowest_layer(socket_).expires_never();
        if (result) throw boost::system::system_error(result);
    }

    static std::string escaped(const std::string& text) {
        static constexpr char digits[] = "0123456789ABCDEF";
        std::string written;
        for (const unsigned char letter : text) {
            const bool is_plain = (letter >= '0' && letter <= '9') || (letter >= 'A' && letter <= 'Z') ||
                                  (letter >= 'a' && letter <= 'z') || letter == '-' || letter == '_';
            if (is_plain)
                written += static_cast<char>(letter);
            else
                written.append({'%', digits[letter >> 4], digits[letter & 15]});
        }
        return written;
    }

    std::chrono::milliseconds timeout_;
    boost::asio::io_context context_{1};
    boost::beast::websocket::stream<boost::beast::tcp_stream, false> socket_;
    boost::beast::flat_buffer buffer_;
};

}  // namespace detail

AUTODRIVE_INLINE Client::Client(const std::string& host, unsigned short port, const std::string& token,
                                const Subscription& subscription, std::chrono::milliseconds timeout)
    : connection_(std::make_unique<detail::Connection>(host, port, token, timeout)) {
    send({{"type", "Hello"}, {"protocol", PROTOCOL}, {"name", "C++"}});
    Json subscribe = {{"type", "Subscribe"}, {"scans", subscription.scans}, {"picture_rate", subscription.picture_rate}};
    subscribe["frame_rate"] = subscription.frame_rate ? Json(*subscription.frame_rate) : Json();
    send(subscribe);
    while (welcome_.is_null() || scene_.is_null()) handle(receive());
}

AUTODRIVE_INLINE Client::Client() : Client(detail::default_target()) {}

AUTODRIVE_INLINE Client::Client(const detail::Target& target) : Client(target.host, target.port) {
    detail::check_welcome(welcome_, target);
    std::cerr << "autodrive: connected to '" << welcome_.value("title", "") << "' at "
              << detail::address_text(target.host, target.port) << ", started by "
              << detail::described(welcome_.value("run", Json())) << std::endl;
}

AUTODRIVE_INLINE Client::~Client() = default;
AUTODRIVE_INLINE Client::Client(Client&&) noexcept = default;
AUTODRIVE_INLINE Client& Client::operator=(Client&&) noexcept = default;

AUTODRIVE_INLINE Frame Client::next() {
    while (!is_new_) handle(receive());
    is_new_ = false;
    return frame_;
}

AUTODRIVE_INLINE void Client::drive(const std::string& vehicle, const Command& command) {
    send({{"type", "Drive"}, {"vehicle", vehicle}, {"command", wire::write(command)}});
}

AUTODRIVE_INLINE Frame Client::step(int ticks, const std::map<std::string, Command>& commands) {
    Json json = Json::object();
    for (const auto& [vehicle, command] : commands) json[vehicle] = wire::write(command);
    return request({{"type", "Step"}, {"ticks", ticks}, {"commands", json}});
}

AUTODRIVE_INLINE Frame Client::pause() { return request({{"type", "Pause"}}); }
AUTODRIVE_INLINE Frame Client::resume() { return request({{"type", "Resume"}}); }
AUTODRIVE_INLINE Frame Client::reset() { return request({{"type", "Reset"}}); }

AUTODRIVE_INLINE Frame Client::teleport(const std::string& vehicle, double x, double y, double yaw) {
    return request({{"type", "Teleport"}, {"vehicle", vehicle}, {"x", x}, {"y", y}, {"yaw", yaw}});
}

AUTODRIVE_INLINE Frame Client::set_time_of_day(double time, double scale) {
    return request({{"type", "SetTimeOfDay"}, {"time", time}, {"scale", scale}});
}

AUTODRIVE_INLINE Frame Client::set_weather(const Weather& weather) {
    return request({{"type", "SetWeather"}, {"weather", wire::write(weather)}});
}

AUTODRIVE_INLINE Frame Client::set_traffic_light(const std::string& light, std::optional<int> state) {
    return request({{"type", "SetTrafficLight"}, {"light", light}, {"state", state ? Json(*state) : Json()}});
}

AUTODRIVE_INLINE Frame Client::draw(const std::string& name, const Drawing& drawing) {
    return request({{"type", "Draw"}, {"drawings", {{name, wire::write(drawing)}}}});
}

AUTODRIVE_INLINE Frame Client::clear_drawings(const std::optional<std::string>& name) {
    Json drawings = Json::object();
    if (name) drawings[*name] = nullptr;
    return request({{"type", "Draw"}, {"drawings", drawings}, {"clears", !name}});
}

AUTODRIVE_INLINE Frame Client::request(const Json& request) {
    const std::int64_t id = next_id_++;
    send({{"type", "Request"}, {"id", id}, {"operation", request}});
    while (true) {
        const Json message = receive();
        if (message.value("id", Json()) == id) {
            if (message.at("type") == "Error") throw Refused(message.at("text").get<std::string>());
            set_frame(message.at("frame"));
            is_new_ = false;
            return frame_;
        }
        handle(message);
    }
}

AUTODRIVE_INLINE void Client::send(const Json& message) { connection_->send(Json::to_msgpack(message)); }

AUTODRIVE_INLINE Json Client::receive() {
    const auto [bytes, size] = connection_->receive();
    return detail::Unpacker(bytes, size).value();
}

AUTODRIVE_INLINE void Client::handle(const Json& message) {
    const std::string& type = message.at("type").get_ref<const std::string&>();
    if (type == "Frame") {
        set_frame(message);
    } else if (type == "Scan") {
        auto scan = wire::read<Scan>(message);
        scans_[scan.vehicle] = std::move(scan.scan);
    } else if (type == "Picture") {
        auto picture = wire::read<Picture>(message);
        pictures_[{picture.vehicle, picture.camera}] = std::move(picture);
    } else if (type == "Status") {
        status_ = message;
    } else if (type == "Scene") {
        scene_ = message;
        scans_.clear();
        pictures_.clear();
        is_new_ = false;
    } else if (type == "Welcome") {
        welcome_ = message;
    } else if (type == "Error") {
        throw Refused(message.at("text").get<std::string>());
    }
}

AUTODRIVE_INLINE void Client::set_frame(const Json& json) {
    auto frame = wire::read<Frame>(json);
    if (is_new_) frame.events.insert(frame.events.begin(), frame_.events.begin(), frame_.events.end());
    frame_ = std::move(frame);
    is_new_ = true;
    for (auto& [name, vehicle] : frame_.vehicles)
        if (const auto scan = scans_.find(name); scan != scans_.end()) vehicle.lidar = scan->second;
}

}  // namespace autodrive
