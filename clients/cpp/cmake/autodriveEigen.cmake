# Sets autodrive_eigen_error unless the Eigen that was found is 3.3 to 5. Its own version file cannot check this: it refuses
# a requested version with another major version.
set(autodrive_eigen_error "")
if(Eigen3_VERSION VERSION_LESS 3.3 OR Eigen3_VERSION VERSION_GREATER_EQUAL 6)
    set(autodrive_eigen_error "Eigen 3.3 to 5 is needed, and ${Eigen3_VERSION} was found in ${Eigen3_DIR}")
endif()
