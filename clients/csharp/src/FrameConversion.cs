namespace Nep
{
    /// <summary>Conversion of coordinates between ROS (x forward, y left, z up, right-handed) and Unity (x right, y up, z forward, left-handed).</summary>
    /// <remarks>
    /// Lengths remain in metres. Angular velocities are converted like the vector part of a rotation, with
    /// <see cref="RosToUnityRotation"/> and <see cref="UnityToRosRotation"/>.
    /// </remarks>
    public static class FrameConversion
    {
        /// <summary>Convert a position, direction or velocity from ROS to Unity.</summary>
        /// <param name="x">Forward, in metres.</param>
        /// <param name="y">Left, in metres.</param>
        /// <param name="z">Up, in metres.</param>
        /// <param name="unityX">Right, in metres.</param>
        /// <param name="unityY">Up, in metres.</param>
        /// <param name="unityZ">Forward, in metres.</param>
        public static void RosToUnity(double x, double y, double z, out double unityX, out double unityY, out double unityZ)
        {
            unityX = -y;
            unityY = z;
            unityZ = x;
        }

        /// <summary>Convert a position, direction or velocity from Unity to ROS.</summary>
        /// <param name="x">Right, in metres.</param>
        /// <param name="y">Up, in metres.</param>
        /// <param name="z">Forward, in metres.</param>
        /// <param name="rosX">Forward, in metres.</param>
        /// <param name="rosY">Left, in metres.</param>
        /// <param name="rosZ">Up, in metres.</param>
        public static void UnityToRos(double x, double y, double z, out double rosX, out double rosY, out double rosZ)
        {
            rosX = z;
            rosY = -x;
            rosZ = y;
        }

        /// <summary>Convert a rotation (unit quaternion) from ROS to Unity; w is unchanged.</summary>
        /// <param name="x">Vector part, forward.</param>
        /// <param name="y">Vector part, left.</param>
        /// <param name="z">Vector part, up.</param>
        /// <param name="unityX">Vector part, right.</param>
        /// <param name="unityY">Vector part, up.</param>
        /// <param name="unityZ">Vector part, forward.</param>
        public static void RosToUnityRotation(double x, double y, double z, out double unityX, out double unityY, out double unityZ)
        {
            unityX = y; // changing the handedness inverts the axis
            unityY = -z;
            unityZ = -x;
        }

        /// <summary>Convert a rotation (unit quaternion) from Unity to ROS; w is unchanged.</summary>
        /// <param name="x">Vector part, right.</param>
        /// <param name="y">Vector part, up.</param>
        /// <param name="z">Vector part, forward.</param>
        /// <param name="rosX">Vector part, forward.</param>
        /// <param name="rosY">Vector part, left.</param>
        /// <param name="rosZ">Vector part, up.</param>
        public static void UnityToRosRotation(double x, double y, double z, out double rosX, out double rosY, out double rosZ)
        {
            rosX = -z;
            rosY = x;
            rosZ = -y;
        }
    }
}
