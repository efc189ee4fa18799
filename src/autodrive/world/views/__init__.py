"""What people, clients and cameras see of worlds: scene files, images, the weather in numbers."""
