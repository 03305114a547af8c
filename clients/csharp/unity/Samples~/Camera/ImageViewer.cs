using Nep;
using Nep.Unity;
using UnityEngine;

/// <summary>Shows the newest image of a topic on the material of this game object.</summary>
[RequireComponent(typeof(Renderer))]
public sealed class ImageViewer : MonoBehaviour
{
    [SerializeField] private NepConnection connection;
    [SerializeField] private string topic = "robot/camera";

    private Texture2D _texture;

    private void Start()
    {
        _texture = new Texture2D(2, 2);
        GetComponent<Renderer>().material.mainTexture = _texture;
        var options = new SubscriberOptions { Callbacks = CallbackMode.Update, KeepLatest = true };
        connection.Node.Subscribe(topic, message => _texture.LoadImage(message.Payload), "image", options);
    }

    private void OnDestroy()
    {
        Destroy(_texture);
    }
}
