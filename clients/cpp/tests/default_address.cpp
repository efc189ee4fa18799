// Prints the map of the simulator to which a client without an address connects, or why it does not.
#include <autodrive/client.hpp>
#include <cstdlib>
#include <iostream>

int main(int argc, char** argv) {
    try {
        if (argc > 2) {
            autodrive::Client simulator(argv[1], static_cast<unsigned short>(std::atoi(argv[2])));
            std::cout << simulator.scene().at("title").get<std::string>() << std::endl;
        } else {
            autodrive::Client simulator;
            std::cout << simulator.scene().at("title").get<std::string>() << std::endl;
        }
    } catch (const autodrive::Refused& refused) {
        std::cout << refused.what() << std::endl;
    }
}
