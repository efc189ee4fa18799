#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <csignal>
#include <iostream>
#include <memory>

#include "autodrive/devkit.hpp"

namespace autodrive::devkit {

namespace detail {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using Tcp = asio::ip::tcp;
using Error = beast::error_code;

/// Engine.IO session with one simulator over WebSocket, from the HTTP request to the end of the connection.
class Session : public std::enable_shared_from_this<Session> {
public:
    /// Returns the answer to a message; an empty text is not sent.
    using Answer = std::function<std::string(std::string_view event)>;

    Session(Tcp::socket socket, Answer answer)
        : socket_(std::move(socket)), timer_(socket_.get_executor()), answer_(std::move(answer)) {}

    void start() {
        Error ignored;
        beast::get_lowest_layer(socket_).socket().set_option(Tcp::no_delay(true), ignored);
        beast::get_lowest_layer(socket_).expires_after(handshake_timeout);
        request_parser_.emplace();
        http::async_read(socket_.next_layer(), buffer_, *request_parser_,
                         [self = shared_from_this()](Error error, std::size_t) {
                             if (!error) self->welcome(self->request_parser_->release());
                         });
    }

private:
    static constexpr std::chrono::seconds handshake_timeout{10};
    static constexpr std::chrono::seconds ping_interval{25};
    static constexpr std::size_t message_limit = std::size_t{1} << 24;

    void welcome(http::request<http::string_body> request) {
        const std::string target(request.target());
        if (target.rfind("/socket.io/", 0) != 0 || !beast::websocket::is_upgrade(request)) {
            refuse(request);
            return;
        }
        // with Engine.IO 3 the server opens the namespace; the original simulator announces version 4 but uses 3
        is_engine_io_3_ = target.find("EIO=3") != std::string::npos;
        beast::get_lowest_layer(socket_).expires_never();
        socket_.read_message_max(message_limit);
        socket_.text(true);
        socket_.async_accept(request, [self = shared_from_this()](Error error) {
            if (error) return;
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
        response->keep_alive(false);
        response->prepare_payload();
        http::async_write(socket_.next_layer(), *response,
                          [self = shared_from_this(), response](Error, std::size_t) { self->close(); });
    }

    void listen() {
        socket_.async_read(buffer_, [self = shared_from_this()](Error error, std::size_t) {
            if (error) {
                self->close();
                return;
            }
            const auto data = self->buffer_.cdata();
            self->handle({static_cast<const char*>(data.data()), data.size()});
            self->buffer_.consume(self->buffer_.size());
            self->listen();
        });
    }

    void handle(std::string_view packet) {
        const auto begins = [packet](const char* start) { return packet.rfind(start, 0) == 0; };
        if (begins("42")) {  // an event, with a number if an acknowledgement is requested
            const std::size_t body = packet.find('[');
            if (body == std::string_view::npos) return;
            if (std::string text = answer_(packet.substr(body)); !text.empty()) send(std::move(text));
            if (body > 2) send("43" + std::string(packet.substr(2, body - 2)) + "[]");
        } else if (begins("40") && !is_engine_io_3_) {
            send(R"(40{"sid":"autodrive"})");
        } else if (begins("2")) {
            send("3" + std::string(packet.substr(1)));
        }
    }

    void ping_later() {
        timer_.expires_after(ping_interval);
        timer_.async_wait([self = shared_from_this()](Error error) {
            if (error) return;
            self->send("2");
            self->ping_later();
        });
    }

    void send(std::string packet) {
        queue_.push_back(std::move(packet));
        if (queue_.size() == 1) write_next();
    }

    void write_next() {
        socket_.async_write(asio::buffer(queue_.front()), [self = shared_from_this()](Error error, std::size_t) {
            if (error) {
                self->close();
                return;
            }
            self->queue_.pop_front();
            if (!self->queue_.empty()) self->write_next();
        });
    }

    void close() {
        timer_.cancel();
        beast::get_lowest_layer(socket_).close();
    }

    beast::websocket::stream<beast::tcp_stream, false> socket_;  // without compression: scans and images are compressed already
    asio::steady_timer timer_;
    Answer answer_;
    beast::flat_buffer buffer_;
    std::optional<http::request_parser<http::string_body>> request_parser_;
    std::deque<std::string> queue_;
    bool is_engine_io_3_ = false;
};

inline void accept(Tcp::acceptor& acceptor, const Session::Answer& answer) {
    acceptor.async_accept([&acceptor, answer](Error error, Tcp::socket socket) {
        if (!error) std::make_shared<Session>(std::move(socket), answer)->start();
        if (acceptor.is_open()) accept(acceptor, answer);
    });
}

}  // namespace detail

AUTODRIVE_INLINE void Server::run(unsigned short port, const std::string& host,
                                  const std::function<void(unsigned short)>& listening) {
    detail::asio::io_context context(1);
    detail::Tcp::acceptor acceptor(context, {detail::asio::ip::make_address(host), port});
    detail::asio::signal_set signals(context, SIGINT, SIGTERM);
    signals.async_wait([this](detail::Error error, int) {
        if (!error) stop();
    });
    detail::accept(acceptor, [this](std::string_view event) { return answer(event); });
    const auto set_end = [this](std::function<void()> end) {
        const std::lock_guard lock(mutex_);
        end_ = std::move(end);
    };
    set_end([&context] { context.stop(); });
    try {
        if (listening) listening(acceptor.local_endpoint().port());
        context.run();
    } catch (...) {
        exception_ = std::current_exception();
    }
    set_end({});
    if (const auto exception = std::exchange(exception_, nullptr)) std::rethrow_exception(exception);
}

AUTODRIVE_INLINE std::string Server::answer(std::string_view event) {
    const auto telemetry = Telemetry::parse(event);
    if (!telemetry || telemetry->empty()) return "";
    try {
        Json message = Json::object();
        for (auto& [name, driver] : drivers_) {
            for (const std::string& error : read(*telemetry, driver.prefix, driver.state)) report(error);
            write(driver.drive(driver.state), driver.prefix, message);
        }
        if (respond_)
            for (const auto& [key, value] : respond_(telemetry->json()).items()) message[key] = value;
        return message.empty() ? "" : "42" + Json::array({"Bridge", message}).dump();
    } catch (...) {
        exception_ = std::current_exception();
        stop();
        return "";
    }
}

AUTODRIVE_INLINE void Server::report(const std::string& error) {
    if (on_error_)
        on_error_(error);
    else if (reported_.insert(error.substr(0, error.find(':'))).second)
        std::cerr << "autodrive: cannot read " << error << std::endl;
}

}  // namespace autodrive::devkit
