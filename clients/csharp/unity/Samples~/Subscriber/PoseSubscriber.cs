using Nep;
using Nep.Unity;
using UnityEngine;

/// <summary>Moves this game object to poses in ROS coordinates.</summary>
public sealed class PoseSubscriber : MonoBehaviour
{
    [SerializeField] private NepConnection connection;
    [SerializeField] private string topic = "robot/pose";

    private void Start()
    {
        var options = new SubscriberOptions { Callbacks = CallbackMode.Update, KeepLatest = true };
        connection.Node.Subscribe(topic, Move, "geometry_msgs/Pose", options);
    }

    private void Move(Message message)
    {
        Pose pose = message.As<Pose>();
        transform.position = RosConversions.ToUnity(pose.position.x, pose.position.y, pose.position.z);
        transform.rotation = RosConversions.ToUnity(pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w);
    }

    // The fields have the names of the JSON message.
    private struct Pose
    {
        public Vector position;
        public Vector orientation;
    }

    private struct Vector
    {
        public double x;
        public double y;
        public double z;
        public double w;
    }
}
