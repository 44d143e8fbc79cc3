from jumping_ant.base import portable

portable.switch()  # before anything imports a numerical library
