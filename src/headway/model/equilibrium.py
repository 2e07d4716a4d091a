from headway.models.equilibrium import *  # temporary
