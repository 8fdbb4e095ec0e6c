"""What both kinds of drive are used through: drive files, controllers, closed loops."""
