// A driving script with a constant command, to measure the server itself.
#include <autodrive/devkit.hpp>
#include <iostream>

int main() {
    autodrive::devkit::Server server;
    server.on_state([](const autodrive::devkit::State&) {
        autodrive::devkit::Command command;
        command.throttle = 0.5;
        command.steering = 0.1;
        return command;
    });
    server.run(0, "127.0.0.1", [](unsigned short port) { std::cout << port << std::endl; });
}
