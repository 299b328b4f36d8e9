"""ROS 2 robots: messages over Zenoh (`wire`), driven robots (`robot`), simulated ones (`sim`), and `doctor`."""
